//! One number per leg, or per contact, computed for all four at once with the widest instructions of the processor.
//!
//! Every operation is rounded on its own: no multiplication is fused with an addition, and the results have the same bits with all
//! instructions and on all machines.

use std::fmt;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, u64x4};
use nalgebra::Vector3;

use super::spatial::{AxisRotation, Real};
use crate::robot::PerLeg;

/// One number per leg in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(super) struct Quad(pub PerLeg<f64>);

impl Quad {
    /// Zero for every leg.
    pub const ZERO: Quad = Quad([0.0; 4]);

    /// One vector per leg as a vector of lanes.
    pub fn vectors(v: &PerLeg<Vector3<f64>>) -> Vector3<Quad> {
        Vector3::from_fn(|i, _| Quad(v.map(|v| v[i])))
    }
}

/// One number per leg in registers.
#[derive(Clone, Copy)]
pub(super) struct Lanes<S: Simd>(f64x4<S>);

/// Evaluates `$kernel` with the instructions of the [`Level`](fearless_simd::Level) `$level`, whose token is `$simd`. Functions that it
/// calls are compiled for them if they are `#[inline(always)]`. On x86-64 that is AVX2 or SSE2: the levels between and above them gain
/// less than their code costs.
#[cfg(target_arch = "x86_64")]
macro_rules! with_lanes {
    ($level:expr, $simd:ident => $kernel:expr) => {
        match fearless_simd::Level::as_avx2($level) {
            Some($simd) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $kernel,
            ),
            None => fearless_simd::dispatch!(fearless_simd::Level::baseline(), $simd => $kernel),
        }
    };
}
/// Evaluates `$kernel` with the instructions of `$level`, whose token is `$simd`.
#[cfg(not(target_arch = "x86_64"))]
macro_rules! with_lanes {
    ($level:expr, $simd:ident => $kernel:expr) => {
        fearless_simd::dispatch!($level, $simd => $kernel)
    };
}
pub(super) use with_lanes;

impl<S: Simd> Lanes<S> {
    /// Takes the numbers of the legs.
    #[inline(always)]
    pub fn new(simd: S, x: PerLeg<f64>) -> Self {
        Lanes(f64x4::simd_from(simd, x))
    }

    /// The same number for all legs.
    #[inline(always)]
    pub fn splat(simd: S, x: f64) -> Self {
        Lanes(f64x4::simd_from(simd, x))
    }

    /// Loads the numbers of the legs.
    #[inline(always)]
    pub fn load(simd: S, x: Quad) -> Self {
        Lanes::new(simd, x.0)
    }

    /// Loads the vectors of the legs.
    #[inline(always)]
    pub fn vector(simd: S, v: &Vector3<Quad>) -> Vector3<Self> {
        Vector3::new(Lanes::load(simd, v.x), Lanes::load(simd, v.y), Lanes::load(simd, v.z))
    }

    /// Stores the numbers of the legs.
    #[inline(always)]
    pub fn store(self) -> Quad {
        Quad(self.0.into())
    }

    /// Sum over the legs.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let [a, b, c, d]: PerLeg<f64> = self.0.into();
        (a + b) + (c + d)
    }

    /// Size of `self` with the sign of `sign`.
    #[inline(always)]
    pub fn copysign(self, sign: Self) -> Self {
        Lanes(self.0.copysign(sign.0))
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        Lanes(self.0.abs())
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Lanes(self.0.sqrt())
    }

    /// Sine and cosine of angles below 2^51 rad, within 2e-16 for angles of a joint; NaN for other than finite ones. Reduction to
    /// [-pi/4, pi/4] in three parts (Cody and Waite) and polynomials with the coefficients of the Cephes library.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        const SINE: [f64; 6] = [
            -0.1666666666666663,
            0.008333333333322118,
            -0.0001984126982958954,
            2.7557313621385722e-6,
            -2.5050747762857807e-8,
            1.5896230157654656e-10,
        ];
        const COSINE: [f64; 6] = [
            0.041666666666666595,
            -0.0013888888888873056,
            2.4801587288851704e-5,
            -2.755731417929674e-7,
            2.087570084197473e-9,
            -1.1358536521387682e-11,
        ];
        /// pi/2 in parts; the first two have zeros at their ends, so that a small multiple of them is exact.
        const HALF_PI: [f64; 3] = [0.7853981554508209 * 2.0, 7.946627356147928e-9 * 2.0, 3.061616997868383e-17 * 2.0];
        /// A number added to another one is rounded to an integer in its last bits.
        const TO_INTEGER: f64 = 1.5 * (1_u64 << 52) as f64;
        const SIGN: u64 = 1 << 63;

        let x: f64x4<S> = self.0;
        let size = x.abs();
        let shifted = size * (2.0 / std::f64::consts::PI) + TO_INTEGER;
        let quadrant: u64x4<S> = shifted.bitcast();
        let turns = shifted - TO_INTEGER;
        let r = HALF_PI.iter().fold(size, |rest, part| rest - turns * *part);
        let r2 = r * r;
        let sine = r * r2 * polynomial(r2, SINE) + r;
        let cosine = r2 * r2 * polynomial(r2, COSINE) + (-(r2 * 0.5) + 1.0);
        // Sine and cosine change places in odd quadrants. The sine is negative in quadrants 2 and 3, the cosine in 1 and 2.
        let (sine, cosine): (u64x4<S>, u64x4<S>) = (sine.bitcast(), cosine.bitcast());
        let change = (sine ^ cosine) & (u64x4::splat(x.simd, 0) - (quadrant & 1));
        let sign: u64x4<S> = x.bitcast();
        let sine = (sine ^ change) ^ (((quadrant << 62) ^ sign) & SIGN);
        let cosine = (cosine ^ change) ^ (((quadrant + 1) << 62) & SIGN);
        (Lanes(sine.bitcast()), Lanes(cosine.bitcast()))
    }
}

/// c0 + c1 x + ... + c5 x^5 (Estrin's scheme).
#[inline(always)]
fn polynomial<S: Simd>(x: f64x4<S>, [c0, c1, c2, c3, c4, c5]: [f64; 6]) -> f64x4<S> {
    let x2 = x * x;
    (x * c3 + c2) * x2 + ((x * c5 + c4) * (x2 * x2) + (x * c1 + c0))
}

impl<S: Simd> AxisRotation<Lanes<S>> {
    /// Rotation by `angle`.
    #[inline(always)]
    pub fn new(angle: Lanes<S>) -> Self {
        let (sin, cos) = angle.sin_cos();
        AxisRotation { cos, sin }
    }

    /// Loads the rotations of the legs.
    #[inline(always)]
    pub fn load(simd: S, rotation: AxisRotation<Quad>) -> Self {
        AxisRotation { cos: Lanes::load(simd, rotation.cos), sin: Lanes::load(simd, rotation.sin) }
    }
}

impl<S: Simd> Real for Lanes<S> {
    #[inline(always)]
    fn splat(self, x: f64) -> Self {
        Lanes::splat(self.0.simd, x)
    }
}

impl<S: Simd> PartialEq for Lanes<S> {
    fn eq(&self, other: &Self) -> bool {
        self.store() == other.store()
    }
}

impl<S: Simd> fmt::Debug for Lanes<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.store().fmt(f)
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Lanes(-self.0)
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident $assignment:ident $assign:ident),*) => {$(
        impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes(self.0.$method(other.0))
            }
        }

        impl<S: Simd> $assignment for Lanes<S> {
            #[inline(always)]
            fn $assign(&mut self, other: Self) {
                self.0 = self.0.$method(other.0);
            }
        }
    )*};
}
operators!(Add add AddAssign add_assign, Sub sub SubAssign sub_assign, Mul mul MulAssign mul_assign, Div div DivAssign div_assign);
