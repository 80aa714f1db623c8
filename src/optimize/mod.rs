//! The optimizer: ask and tell over plain numbers. It does not know what a robot is.

pub mod journal;
pub mod mt19937;
pub mod parzen;
pub mod sampler;
pub mod space;
pub mod study;
pub mod tpe;
pub mod trial;
pub mod truncnorm;
