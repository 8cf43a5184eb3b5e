//! Imports from outside: refusals, reports and limits of MJCF and URDF.
#![allow(clippy::unwrap_used, clippy::panic)]

mod import_errors;
mod import_extensions;
mod import_meshes;
mod import_stops;
