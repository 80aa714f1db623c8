//! Spatial inertia, motion and force at one common point (Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter
//! 2), specialized to symmetric matrices and to joints about x and y.
//!
//! `T` is one number, or one SIMD lane per leg.

use std::ops::Neg;

use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign, Matrix3, Scalar, Vector3};

/// One number, or one per lane.
pub(super) trait Real:
    Scalar + Copy + ClosedAddAssign + ClosedSubAssign + ClosedMulAssign + ClosedDivAssign + Neg<Output = Self>
{
    /// The number `x`, in every lane of `self`.
    fn splat(self, x: f64) -> Self;
}

impl Real for f64 {
    #[inline(always)]
    fn splat(self, x: f64) -> f64 {
        x
    }
}

/// a x b. (nalgebra's is not inlined for lanes.)
#[inline(always)]
pub(super) fn cross<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// a . b. (nalgebra's is not inlined for lanes.)
#[inline(always)]
pub(super) fn inner<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Rotation about one coordinate axis, as cosine and sine.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisRotation<T> {
    pub cos: T,
    pub sin: T,
}

impl<T: Scalar + Copy> AxisRotation<T> {
    /// Applies `f` to cosine and sine.
    #[inline(always)]
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> AxisRotation<U> {
        AxisRotation { cos: f(self.cos), sin: f(self.sin) }
    }
}

impl<T: Real> AxisRotation<T> {
    /// Rx v: from the rotated frame to the original one.
    #[inline(always)]
    pub fn rotate_x(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(v.x, self.cos * v.y - self.sin * v.z, self.sin * v.y + self.cos * v.z)
    }

    /// Rx^T v.
    #[inline(always)]
    pub fn unrotate_x(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(v.x, self.cos * v.y + self.sin * v.z, self.cos * v.z - self.sin * v.y)
    }

    /// Ry v.
    #[inline(always)]
    pub fn rotate_y(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(self.cos * v.x + self.sin * v.z, v.y, self.cos * v.z - self.sin * v.x)
    }

    /// Ry^T v.
    #[inline(always)]
    pub fn unrotate_y(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(self.cos * v.x - self.sin * v.z, v.y, self.sin * v.x + self.cos * v.z)
    }
}

/// Symmetric 3x3 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SymmetricMatrix<T> {
    pub xx: T,
    pub xy: T,
    pub xz: T,
    pub yy: T,
    pub yz: T,
    pub zz: T,
}

impl<T: Copy> SymmetricMatrix<T> {
    /// Applies `f` to each element.
    #[inline(always)]
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> SymmetricMatrix<U> {
        let SymmetricMatrix { xx, xy, xz, yy, yz, zz } = *self;
        SymmetricMatrix { xx: f(xx), xy: f(xy), xz: f(xz), yy: f(yy), yz: f(yz), zz: f(zz) }
    }
}

impl<T: Real> SymmetricMatrix<T> {
    #[inline(always)]
    fn plus(&self, o: &SymmetricMatrix<T>) -> SymmetricMatrix<T> {
        SymmetricMatrix {
            xx: self.xx + o.xx,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yy: self.yy + o.yy,
            yz: self.yz + o.yz,
            zz: self.zz + o.zz,
        }
    }

    #[inline(always)]
    pub fn times(&self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// The cofactors and the determinant.
    #[inline(always)]
    pub fn cofactors(&self) -> (SymmetricMatrix<T>, T) {
        let SymmetricMatrix { xx, xy, xz, yy, yz, zz } = *self;
        let cofactors = SymmetricMatrix {
            xx: yy * zz - yz * yz,
            xy: xz * yz - xy * zz,
            xz: xy * yz - xz * yy,
            yy: xx * zz - xz * xz,
            yz: xy * xz - xx * yz,
            zz: xx * yy - xy * xy,
        };
        (cofactors, xx * cofactors.xx + xy * cofactors.xy + xz * cofactors.xz)
    }

    /// A^-1 v of a positive matrix, by cofactors.
    #[inline(always)]
    fn inverse_times(&self, v: &Vector3<T>) -> Vector3<T> {
        let (cofactors, determinant) = self.cofactors();
        cofactors.times(v) / determinant
    }
}

/// A body's spatial inertia about the origin of the frame that it is expressed in (Featherstone eq. 2.63).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpatialInertia<T> {
    /// m, kg.
    pub mass: T,
    /// First moment h = m c, kg m.
    pub first: Vector3<T>,
    /// Rotational inertia about the origin, kg m^2.
    pub second: SymmetricMatrix<T>,
}

impl SpatialInertia<f64> {
    /// Creates it from mass, centre of mass and inertia about the centre of mass.
    pub fn new(mass: f64, com: &Vector3<f64>, inertia_com: &Matrix3<f64>) -> SpatialInertia<f64> {
        // I_O = I_C + m (c.c 1 - c c^T)
        let m = inertia_com + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        let second = SymmetricMatrix { xx: m.m11, xy: m.m12, xz: m.m13, yy: m.m22, yz: m.m23, zz: m.m33 };
        SpatialInertia { mass, first: com * mass, second }
    }
}

impl<T: Scalar + Copy> SpatialInertia<T> {
    /// Applies `f` to each element.
    #[inline(always)]
    pub fn map<U: Scalar>(&self, f: impl Fn(T) -> U + Copy) -> SpatialInertia<U> {
        SpatialInertia { mass: f(self.mass), first: self.first.map(f), second: self.second.map(f) }
    }
}

impl<T: Real> SpatialInertia<T> {
    #[inline(always)]
    pub fn plus(&self, o: &SpatialInertia<T>) -> SpatialInertia<T> {
        SpatialInertia { mass: self.mass + o.mass, first: self.first + o.first, second: self.second.plus(&o.second) }
    }

    /// The inertia about a new origin; `r` is the old origin in the new frame.
    #[inline(always)]
    pub fn moved(&self, r: &Vector3<T>) -> SpatialInertia<T> {
        // h' = h + m r;  I' = I + 2 (h.r) 1 - h r^T - r h^T + m (r.r 1 - r r^T) = I + ((h + h').r) 1 - h' r^T - r h^T
        let h = &self.first;
        let new = h + r * self.mass;
        let (x, y, z) = ((h.x + new.x) * r.x, (h.y + new.y) * r.y, (h.z + new.z) * r.z);
        let i = &self.second;
        SpatialInertia {
            mass: self.mass,
            first: new,
            second: SymmetricMatrix {
                xx: i.xx + y + z,
                xy: i.xy - new.x * r.y - r.x * h.y,
                xz: i.xz - new.x * r.z - r.x * h.z,
                yy: i.yy + x + z,
                yz: i.yz - new.y * r.z - r.y * h.z,
                zz: i.zz + x + y,
            },
        }
    }

    /// Ry I Ry^T.
    #[inline(always)]
    pub fn rotated_y(&self, t: AxisRotation<T>) -> SpatialInertia<T> {
        let SymmetricMatrix { xx, xy, xz, yy, yz, zz } = self.second;
        let (cc, ss, cs) = (t.cos * t.cos, t.sin * t.sin, t.cos * t.sin);
        let twice = (cs + cs) * xz;
        SpatialInertia {
            mass: self.mass,
            first: t.rotate_y(&self.first),
            second: SymmetricMatrix {
                xx: cc * xx + twice + ss * zz,
                xy: t.cos * xy + t.sin * yz,
                xz: cs * (zz - xx) + (cc - ss) * xz,
                yy,
                yz: t.cos * yz - t.sin * xy,
                zz: ss * xx - twice + cc * zz,
            },
        }
    }

    /// Rx I Rx^T.
    #[inline(always)]
    pub fn rotated_x(&self, t: AxisRotation<T>) -> SpatialInertia<T> {
        let SymmetricMatrix { xx, xy, xz, yy, yz, zz } = self.second;
        let (cc, ss, cs) = (t.cos * t.cos, t.sin * t.sin, t.cos * t.sin);
        let twice = (cs + cs) * yz;
        SpatialInertia {
            mass: self.mass,
            first: t.rotate_x(&self.first),
            second: SymmetricMatrix {
                xx,
                xy: t.cos * xy - t.sin * xz,
                xz: t.sin * xy + t.cos * xz,
                yy: cc * yy - twice + ss * zz,
                yz: cs * (yy - zz) + (cc - ss) * yz,
                zz: ss * yy + twice + cc * zz,
            },
        }
    }

    /// I v (eq. 2.63): momentum at the velocity `v`, or force for the acceleration `v`.
    #[inline(always)]
    pub fn times(&self, v: &SpatialMotion<T>) -> SpatialForce<T> {
        SpatialForce {
            linear: v.linear * self.mass - cross(&self.first, &v.angular),
            angular: self.second.times(&v.angular) + cross(&self.first, &v.linear),
        }
    }

    /// I a + v x* I v (eq. 5.9): force for the acceleration `a` at the velocity `v`.
    #[inline(always)]
    pub fn force(&self, v: &SpatialMotion<T>, a: &SpatialMotion<T>) -> SpatialForce<T> {
        // With the acceleration of the body's point at the origin a_O = a + w x v:
        //   f = m a_O + w' x h + w x (w x h),  n = I w' + h x a_O + w x I w.
        let (h, w) = (&self.first, &v.angular);
        let at_origin = a.linear + cross(w, &v.linear);
        SpatialForce {
            linear: at_origin * self.mass + cross(&a.angular, h) + cross(w, &cross(w, h)),
            angular: self.second.times(&a.angular) + cross(h, &at_origin) + cross(w, &self.second.times(w)),
        }
    }

    /// Returns the velocity at which the momentum is `momentum`: I^-1 f.
    #[inline(always)]
    pub fn velocity(&self, momentum: &SpatialForce<T>) -> SpatialMotion<T> {
        // With c = h / m:  v = f / m + c x w,  (I + h x c x) w = n - c x f.
        let center = self.first / self.mass;
        let (c, h, i) = (&center, &self.first, &self.second);
        let about_com = SymmetricMatrix {
            xx: i.xx - (c.y * h.y + c.z * h.z),
            xy: i.xy + c.x * h.y,
            xz: i.xz + c.x * h.z,
            yy: i.yy - (c.x * h.x + c.z * h.z),
            yz: i.yz + c.y * h.z,
            zz: i.zz - (c.x * h.x + c.y * h.y),
        };
        let angular = about_com.inverse_times(&(momentum.angular - cross(&center, &momentum.linear)));
        SpatialMotion { linear: momentum.linear / self.mass + cross(&center, &angular), angular }
    }

    /// I s for the joint s = [x; 0] about x through the origin.
    #[inline(always)]
    pub fn times_x(&self) -> SpatialForce<T> {
        let (h, i) = (&self.first, &self.second);
        SpatialForce { linear: Vector3::new(self.mass.splat(0.0), -h.z, h.y), angular: Vector3::new(i.xx, i.xy, i.xz) }
    }

    /// I s for the joint s = [y; o x y] about y through `o`.
    #[inline(always)]
    pub fn times_y(&self, o: &Vector3<T>) -> SpatialForce<T> {
        let (m, h, i) = (self.mass, &self.first, &self.second);
        SpatialForce {
            linear: Vector3::new(h.z - m * o.z, m.splat(0.0), m * o.x - h.x),
            angular: Vector3::new(i.xy + h.y * o.x, i.yy - h.z * o.z - h.x * o.x, i.yz + h.y * o.z),
        }
    }
}

/// A spatial velocity or acceleration at a frame's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpatialMotion<T> {
    /// Linear part: of the body's point at the origin.
    pub linear: Vector3<T>,
    /// Angular part.
    pub angular: Vector3<T>,
}

/// A spatial force (force, and moment about a frame's origin) or momentum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpatialForce<T> {
    /// Force or linear momentum.
    pub linear: Vector3<T>,
    /// Moment about the origin.
    pub angular: Vector3<T>,
}

impl<T: Real> SpatialMotion<T> {
    /// v + s w for the joint about x through the origin, and v x s w (eq. 2.33) at that velocity.
    #[inline(always)]
    pub fn across_joint_x(&self, w: T) -> (SpatialMotion<T>, SpatialMotion<T>) {
        let mut v = *self;
        v.angular.x += w;
        let (l, a, o) = (&v.linear, &v.angular, w.splat(0.0));
        let change =
            SpatialMotion { linear: Vector3::new(o, l.z * w, -l.y * w), angular: Vector3::new(o, a.z * w, -a.y * w) };
        (v, change)
    }

    /// v + s w for the joint about y through `o`, and v x s w at that velocity.
    #[inline(always)]
    pub fn across_joint_y(&self, w: T, o: &Vector3<T>) -> (SpatialMotion<T>, SpatialMotion<T>) {
        // s w = [y w; (-o_z, 0, o_x) w]
        let (lx, lz) = (-o.z * w, o.x * w);
        let mut v = *self;
        v.angular.y += w;
        v.linear.x += lx;
        v.linear.z += lz;
        let (l, a) = (&v.linear, &v.angular);
        let linear = Vector3::new(a.y * lz - l.z * w, a.z * lx - a.x * lz, l.x * w - a.y * lx);
        (v, SpatialMotion { linear, angular: Vector3::new(-a.z * w, w.splat(0.0), a.x * w) })
    }

    #[inline(always)]
    pub fn plus(&self, o: &SpatialMotion<T>) -> SpatialMotion<T> {
        SpatialMotion { linear: self.linear + o.linear, angular: self.angular + o.angular }
    }
}

impl<T: Real> SpatialForce<T> {
    #[inline(always)]
    pub fn plus(&self, o: &SpatialForce<T>) -> SpatialForce<T> {
        SpatialForce { linear: self.linear + o.linear, angular: self.angular + o.angular }
    }

    #[inline(always)]
    pub fn minus(&self, o: &SpatialForce<T>) -> SpatialForce<T> {
        SpatialForce { linear: self.linear - o.linear, angular: self.angular - o.angular }
    }

    /// s . f for the joint about y through `o`: the joint's torque.
    #[inline(always)]
    pub fn about_y(&self, o: &Vector3<T>) -> T {
        self.angular.y + o.x * self.linear.z - o.z * self.linear.x
    }

    /// Transforms the force to the parent frame, in which this one is rotated by `t` about x and displaced by `r`.
    #[inline(always)]
    pub fn in_parent(&self, t: AxisRotation<T>, r: &Vector3<T>) -> SpatialForce<T> {
        let linear = t.rotate_x(&self.linear);
        SpatialForce { linear, angular: t.rotate_x(&self.angular) + cross(r, &linear) }
    }
}
