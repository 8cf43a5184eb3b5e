//! From a baseline fit to the models that explain the data: the procedure.
//!
//! 1. **Scatter** of the sensors ([`scatter`]): the least noise that the readings can have.
//! 2. **Models** ([`hypothesis`]): the scene with some causes added, refitted by least squares from several starts, all alike.
//! 3. **Contest** ([`contest`]): all under the noise of the best one's residual, with a price for every number.
//! 4. **Across records**: whether a cause predicts records left out ([`across`]), and whether its size differs between them ([`spread`], [`apart`]).
//! 5. **Unseen records** ([`unseen`]): of many records, while what is left is no noise, some are fitted and the others judge.
//! 6. **Numerics** ([`super::numerics`], [`imitation`], [`reading`]): the size that the simulation's own step, mesh and reading of inputs would imitate.
//! 7. **Round** ([`round`]): which of the models is accepted for all this, and which it cannot be told from.
//! 8. **Likeness** ([`alike`]): causes that move the readings just as an accepted one does.
//!
//! [`search`] puts them in order: the best cause is accepted, the next is sought on top of it and of what came second, until none is
//! accepted; then each is taken out again, to see whether it is missed.

pub(super) mod across;
mod alike;
mod apart;
mod coarse;
mod contest;
mod hypothesis;
mod imitation;
mod kept;
mod race;
mod reading;
mod round;
pub(super) mod scatter;
mod search;
mod spread;
mod told;
mod unseen;
mod whole;

pub(super) use across::solved;
pub(super) use apart::carried;
pub(super) use coarse::Coarse;
pub(super) use hypothesis::{Bench, Hypothesis};
pub(super) use round::Evidence;
pub(super) use search::{Found, search};
pub(super) use unseen::counted;
#[cfg(test)]
pub(super) use whole::tests::begun;
pub(super) use whole::{rejoined, searched_on};
