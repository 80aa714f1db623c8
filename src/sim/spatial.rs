//! Spatial inertia and forces at one common point (Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter 2),
//! written out for symmetric matrices.

use nalgebra::{Matrix3, Vector3};

/// Cosine and sine of an angle: a rotation about one axis.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Turn {
    pub cos: f64,
    pub sin: f64,
}

impl Turn {
    pub fn by(angle: f64) -> Turn {
        let (sin, cos) = angle.sin_cos();
        Turn { cos, sin }
    }

    /// Rx v: from a frame turned about x to the one that it was turned from.
    #[inline]
    pub fn x(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(v.x, self.cos * v.y - self.sin * v.z, self.sin * v.y + self.cos * v.z)
    }

    /// Rx^T v.
    #[inline]
    pub fn x_back(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(v.x, self.cos * v.y + self.sin * v.z, self.cos * v.z - self.sin * v.y)
    }

    /// Ry v.
    #[inline]
    pub fn y(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.cos * v.x + self.sin * v.z, v.y, self.cos * v.z - self.sin * v.x)
    }

    /// Ry^T v.
    #[inline]
    pub fn y_back(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.cos * v.x - self.sin * v.z, v.y, self.sin * v.x + self.cos * v.z)
    }
}

/// A symmetric 3x3 matrix.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Symmetric {
    pub xx: f64,
    pub xy: f64,
    pub xz: f64,
    pub yy: f64,
    pub yz: f64,
    pub zz: f64,
}

impl Symmetric {
    pub fn from_matrix(m: &Matrix3<f64>) -> Symmetric {
        Symmetric { xx: m.m11, xy: m.m12, xz: m.m13, yy: m.m22, yz: m.m23, zz: m.m33 }
    }

    /// a b^T + b a^T subtracted from twice a.b on the diagonal: what moving an inertia's point by b adds for h = a.
    #[inline]
    fn shift(a: &Vector3<f64>, b: &Vector3<f64>) -> Symmetric {
        let (x, y, z) = (a.x * b.x, a.y * b.y, a.z * b.z);
        Symmetric {
            xx: 2.0 * (y + z),
            xy: -(a.x * b.y + a.y * b.x),
            xz: -(a.x * b.z + a.z * b.x),
            yy: 2.0 * (x + z),
            yz: -(a.y * b.z + a.z * b.y),
            zz: 2.0 * (x + y),
        }
    }

    #[inline]
    fn plus(&self, o: &Symmetric) -> Symmetric {
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
    pub fn times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }
}

/// A body's spatial inertia about the origin of the frame that it is expressed in (Featherstone eq. 2.63).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Inertia {
    /// m, kg.
    pub mass: f64,
    /// First moment h = m c, kg m.
    pub first: Vector3<f64>,
    /// Rotational inertia about the origin, kg m^2.
    pub second: Symmetric,
}

impl Inertia {
    /// From mass, centre of mass and inertia about it.
    pub fn new(mass: f64, com: &Vector3<f64>, inertia_com: &Matrix3<f64>) -> Inertia {
        // I_O = I_C + m (c.c 1 - c c^T)
        let second = inertia_com + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        Inertia { mass, first: com * mass, second: Symmetric::from_matrix(&second) }
    }

    #[inline]
    pub fn plus(&self, o: &Inertia) -> Inertia {
        Inertia { mass: self.mass + o.mass, first: self.first + o.first, second: self.second.plus(&o.second) }
    }

    /// The same body about an origin that lies at -r: its frame's origin is at `r` in the new one.
    #[inline]
    pub fn moved(&self, r: &Vector3<f64>) -> Inertia {
        // I' = I + 2 (h.r) 1 - h r^T - r h^T + m (r.r 1 - r r^T);  both are the shift of h + m r / 2 by r.
        let half = self.first + r * (0.5 * self.mass);
        Inertia {
            mass: self.mass,
            first: self.first + r * self.mass,
            second: self.second.plus(&Symmetric::shift(&half, r)),
        }
    }

    /// Ry I Ry^T.
    #[inline]
    pub fn turned_y(&self, t: Turn) -> Inertia {
        let Symmetric { xx, xy, xz, yy, yz, zz } = self.second;
        let (cc, ss, cs) = (t.cos * t.cos, t.sin * t.sin, t.cos * t.sin);
        Inertia {
            mass: self.mass,
            first: t.y(&self.first),
            second: Symmetric {
                xx: cc * xx + 2.0 * cs * xz + ss * zz,
                xy: t.cos * xy + t.sin * yz,
                xz: cs * (zz - xx) + (cc - ss) * xz,
                yy,
                yz: t.cos * yz - t.sin * xy,
                zz: ss * xx - 2.0 * cs * xz + cc * zz,
            },
        }
    }

    /// Rx I Rx^T.
    #[inline]
    pub fn turned_x(&self, t: Turn) -> Inertia {
        let Symmetric { xx, xy, xz, yy, yz, zz } = self.second;
        let (cc, ss, cs) = (t.cos * t.cos, t.sin * t.sin, t.cos * t.sin);
        Inertia {
            mass: self.mass,
            first: t.x(&self.first),
            second: Symmetric {
                xx,
                xy: t.cos * xy - t.sin * xz,
                xz: t.sin * xy + t.cos * xz,
                yy: cc * yy - 2.0 * cs * yz + ss * zz,
                yz: cs * (yy - zz) + (cc - ss) * yz,
                zz: ss * yy + 2.0 * cs * yz + cc * zz,
            },
        }
    }

    /// I v (eq. 2.63): the momentum of the velocity `v`, or the force that the acceleration `v` takes.
    #[inline]
    pub fn times(&self, v: &Motion) -> Force {
        Force {
            linear: v.linear * self.mass - self.first.cross(&v.angular),
            angular: self.second.times(&v.angular) + self.first.cross(&v.linear),
        }
    }
}

/// A spatial velocity or acceleration at a frame's origin.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Motion {
    /// Of the body's point at the origin.
    pub linear: Vector3<f64>,
    /// About any point.
    pub angular: Vector3<f64>,
}

/// A spatial force: a force, and its moment about a frame's origin. Also a momentum.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Force {
    /// Force.
    pub linear: Vector3<f64>,
    /// Moment about the origin.
    pub angular: Vector3<f64>,
}

impl Motion {
    #[inline]
    pub fn plus(&self, o: &Motion) -> Motion {
        Motion { linear: self.linear + o.linear, angular: self.angular + o.angular }
    }

    #[inline]
    pub fn scaled(&self, s: f64) -> Motion {
        Motion { linear: self.linear * s, angular: self.angular * s }
    }

    /// v x m (eq. 2.33).
    #[inline]
    pub fn cross(&self, m: &Motion) -> Motion {
        Motion {
            linear: self.angular.cross(&m.linear) + self.linear.cross(&m.angular),
            angular: self.angular.cross(&m.angular),
        }
    }

    /// v x* f (eq. 2.34).
    #[inline]
    pub fn cross_force(&self, f: &Force) -> Force {
        Force {
            linear: self.angular.cross(&f.linear),
            angular: self.angular.cross(&f.angular) + self.linear.cross(&f.linear),
        }
    }

    /// s . f: the power of `f` on this velocity.
    #[inline]
    pub fn dot(&self, f: &Force) -> f64 {
        self.angular.dot(&f.angular) + self.linear.dot(&f.linear)
    }
}

impl Force {
    #[inline]
    pub fn plus(&self, o: &Force) -> Force {
        Force { linear: self.linear + o.linear, angular: self.angular + o.angular }
    }

    /// The same force in a frame from which this one is turned by `t` about x and displaced by `r`.
    #[inline]
    pub fn out_of(&self, t: Turn, r: &Vector3<f64>) -> Force {
        let linear = t.x(&self.linear);
        Force { linear, angular: t.x(&self.angular) + r.cross(&linear) }
    }
}
