//! Spatial inertia and forces at one common point (Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter 2), written out
//! for symmetric matrices and for joints about x and y.
//!
//! `T` is one number, or one number per leg: the four legs are worked out side by side.

use nalgebra::{Matrix3, Vector3};
use simba::simd::SimdRealField;

/// A number, or several in lanes.
pub(super) trait Real: SimdRealField + Copy {}
impl<T: SimdRealField + Copy> Real for T {}

/// Cosine and sine of an angle: a rotation about one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn<T> {
    pub cos: T,
    pub sin: T,
}

impl<T: Real> Turn<T> {
    #[inline]
    pub fn by(angle: T) -> Turn<T> {
        let (sin, cos) = angle.simd_sin_cos();
        Turn { cos, sin }
    }

    /// Rx v: from a frame turned about x to the one that it was turned from.
    #[inline]
    pub fn x(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(v.x, self.cos * v.y - self.sin * v.z, self.sin * v.y + self.cos * v.z)
    }

    /// Rx^T v.
    #[inline]
    pub fn x_back(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(v.x, self.cos * v.y + self.sin * v.z, self.cos * v.z - self.sin * v.y)
    }

    /// Ry v.
    #[inline]
    pub fn y(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(self.cos * v.x + self.sin * v.z, v.y, self.cos * v.z - self.sin * v.x)
    }

    /// Ry^T v.
    #[inline]
    pub fn y_back(self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(self.cos * v.x - self.sin * v.z, v.y, self.sin * v.x + self.cos * v.z)
    }
}

/// A symmetric 3x3 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Symmetric<T> {
    pub xx: T,
    pub xy: T,
    pub xz: T,
    pub yy: T,
    pub yz: T,
    pub zz: T,
}

impl<T: Real> Symmetric<T> {
    #[inline]
    fn plus(&self, o: &Symmetric<T>) -> Symmetric<T> {
        Symmetric {
            xx: self.xx + o.xx,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yy: self.yy + o.yy,
            yz: self.yz + o.yz,
            zz: self.zz + o.zz,
        }
    }

    #[inline]
    pub fn times(&self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }
}

/// A body's spatial inertia about the origin of the frame that it is expressed in (Featherstone eq. 2.63).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Inertia<T> {
    /// m, kg.
    pub mass: T,
    /// First moment h = m c, kg m.
    pub first: Vector3<T>,
    /// Rotational inertia about the origin, kg m^2.
    pub second: Symmetric<T>,
}

impl Inertia<f64> {
    /// From mass, centre of mass and inertia about it.
    pub fn new(mass: f64, com: &Vector3<f64>, inertia_com: &Matrix3<f64>) -> Inertia<f64> {
        // I_O = I_C + m (c.c 1 - c c^T)
        let m = inertia_com + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        let second = Symmetric { xx: m.m11, xy: m.m12, xz: m.m13, yy: m.m22, yz: m.m23, zz: m.m33 };
        Inertia { mass, first: com * mass, second }
    }
}

impl<T: Real> Inertia<T> {
    #[inline]
    pub fn plus(&self, o: &Inertia<T>) -> Inertia<T> {
        Inertia { mass: self.mass + o.mass, first: self.first + o.first, second: self.second.plus(&o.second) }
    }

    /// The same body about an origin that lies at -r: its frame's origin is at `r` in the new one.
    #[inline]
    pub fn moved(&self, r: &Vector3<T>) -> Inertia<T> {
        // h' = h + m r;  I' = I + 2 (h.r) 1 - h r^T - r h^T + m (r.r 1 - r r^T) = I + ((h + h').r) 1 - h' r^T - r h^T
        let h = &self.first;
        let new = h + r * self.mass;
        let (x, y, z) = ((h.x + new.x) * r.x, (h.y + new.y) * r.y, (h.z + new.z) * r.z);
        let i = &self.second;
        Inertia {
            mass: self.mass,
            first: new,
            second: Symmetric {
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
    #[inline]
    pub fn turned_y(&self, t: Turn<T>) -> Inertia<T> {
        let Symmetric { xx, xy, xz, yy, yz, zz } = self.second;
        let (cc, ss, cs) = (t.cos * t.cos, t.sin * t.sin, t.cos * t.sin);
        let twice = (cs + cs) * xz;
        Inertia {
            mass: self.mass,
            first: t.y(&self.first),
            second: Symmetric {
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
    #[inline]
    pub fn turned_x(&self, t: Turn<T>) -> Inertia<T> {
        let Symmetric { xx, xy, xz, yy, yz, zz } = self.second;
        let (cc, ss, cs) = (t.cos * t.cos, t.sin * t.sin, t.cos * t.sin);
        let twice = (cs + cs) * yz;
        Inertia {
            mass: self.mass,
            first: t.x(&self.first),
            second: Symmetric {
                xx,
                xy: t.cos * xy - t.sin * xz,
                xz: t.sin * xy + t.cos * xz,
                yy: cc * yy - twice + ss * zz,
                yz: cs * (yy - zz) + (cc - ss) * yz,
                zz: ss * yy + twice + cc * zz,
            },
        }
    }

    /// I v (eq. 2.63): the momentum of the velocity `v`, or the force that the acceleration `v` takes.
    #[inline]
    pub fn times(&self, v: &Motion<T>) -> Force<T> {
        Force {
            linear: v.linear * self.mass - self.first.cross(&v.angular),
            angular: self.second.times(&v.angular) + self.first.cross(&v.linear),
        }
    }

    /// I s for the joint s = [x; 0] about x through the origin.
    #[inline]
    pub fn times_x(&self) -> Force<T> {
        let (h, i) = (&self.first, &self.second);
        Force { linear: Vector3::new(T::zero(), -h.z, h.y), angular: Vector3::new(i.xx, i.xy, i.xz) }
    }

    /// I s for the joint s = [y; o x y] about y through `o`.
    #[inline]
    pub fn times_y(&self, o: &Vector3<T>) -> Force<T> {
        let (m, h, i) = (self.mass, &self.first, &self.second);
        Force {
            linear: Vector3::new(h.z - m * o.z, T::zero(), m * o.x - h.x),
            angular: Vector3::new(i.xy + h.y * o.x, i.yy - h.z * o.z - h.x * o.x, i.yz + h.y * o.z),
        }
    }
}

/// A spatial velocity or acceleration at a frame's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion<T> {
    /// Of the body's point at the origin.
    pub linear: Vector3<T>,
    /// About any point.
    pub angular: Vector3<T>,
}

/// A spatial force: a force, and its moment about a frame's origin. Also a momentum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Force<T> {
    /// Force.
    pub linear: Vector3<T>,
    /// Moment about the origin.
    pub angular: Vector3<T>,
}

impl<T: Real> Motion<T> {
    /// v + s w for the joint about x through the origin, and v x s w (eq. 2.33) at that velocity.
    #[inline]
    pub fn joined_x(&self, w: T) -> (Motion<T>, Motion<T>) {
        let mut v = *self;
        v.angular.x += w;
        let (l, a, o) = (&v.linear, &v.angular, T::zero());
        let change = Motion { linear: Vector3::new(o, l.z * w, -l.y * w), angular: Vector3::new(o, a.z * w, -a.y * w) };
        (v, change)
    }

    /// v + s w for the joint about y through `o`, and v x s w at that velocity.
    #[inline]
    pub fn joined_y(&self, w: T, o: &Vector3<T>) -> (Motion<T>, Motion<T>) {
        // s w = [y w; (-o_z, 0, o_x) w]
        let (lx, lz) = (-o.z * w, o.x * w);
        let mut v = *self;
        v.angular.y += w;
        v.linear.x += lx;
        v.linear.z += lz;
        let (l, a) = (&v.linear, &v.angular);
        let linear = Vector3::new(a.y * lz - l.z * w, a.z * lx - a.x * lz, l.x * w - a.y * lx);
        (v, Motion { linear, angular: Vector3::new(-a.z * w, T::zero(), a.x * w) })
    }

    #[inline]
    pub fn plus(&self, o: &Motion<T>) -> Motion<T> {
        Motion { linear: self.linear + o.linear, angular: self.angular + o.angular }
    }

    /// v x* f (eq. 2.34).
    #[inline]
    pub fn cross_force(&self, f: &Force<T>) -> Force<T> {
        Force {
            linear: self.angular.cross(&f.linear),
            angular: self.angular.cross(&f.angular) + self.linear.cross(&f.linear),
        }
    }
}

impl<T: Real> Force<T> {
    #[inline]
    pub fn plus(&self, o: &Force<T>) -> Force<T> {
        Force { linear: self.linear + o.linear, angular: self.angular + o.angular }
    }

    /// s . f for the joint about y through `o`: the torque there.
    #[inline]
    pub fn about_y(&self, o: &Vector3<T>) -> T {
        self.angular.y + o.x * self.linear.z - o.z * self.linear.x
    }

    /// The same force in a frame from which this one is turned by `t` about x and displaced by `r`.
    #[inline]
    pub fn out_of(&self, t: Turn<T>, r: &Vector3<T>) -> Force<T> {
        let linear = t.x(&self.linear);
        Force { linear, angular: t.x(&self.angular) + r.cross(&linear) }
    }
}
