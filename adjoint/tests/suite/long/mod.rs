//! Gradients of whole rollouts against differences: some seconds to minutes each, left out by `tests/run fast`.

mod cloth;
mod contact_of_bodies;
mod contact_rules;
mod couplings;
mod edges_gradients;
mod gradients;
mod grasp;
mod random_scenes;
mod rings;
mod rods;
mod rods_memory;
mod rods_section;
