//! Contact laws at one point.
