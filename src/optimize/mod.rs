//! The optimizer: ask and tell over plain numbers. It does not know what a robot is.

pub mod mt19937;
pub mod parzen;
pub mod sampler;
pub mod space;
pub mod tpe;
pub mod trial;
pub mod truncnorm;
