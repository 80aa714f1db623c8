//! Upright boxes on the ground.

use nalgebra::{Vector2, Vector3};

/// An upright box on the ground, with its velocity.
#[derive(Debug, Clone, Copy)]
pub struct TerrainBlock {
    /// Centre in the world's horizontal plane, m.
    pub center: Vector2<f64>,
    /// Half of the two edges, m.
    pub half: Vector2<f64>,
    /// Direction of the box's x in the world.
    pub axis: Vector2<f64>,
    /// Height of the top, m.
    pub top: f64,
    /// Coulomb coefficient of its surface.
    pub friction: f64,
    /// Velocity in the world's horizontal plane, m/s.
    pub velocity: Vector2<f64>,
    /// Whether `velocity` is that of the end of this step.
    pub(super) moved: bool,
    /// Whether it is in the list of the blocks that move.
    pub(super) listed: bool,
}

impl TerrainBlock {
    /// Returns a block at rest whose top is at height zero.
    pub fn new(center: Vector2<f64>, half: Vector2<f64>, axis: Vector2<f64>, friction: f64) -> TerrainBlock {
        let velocity = Vector2::zeros();
        TerrainBlock { center, half, axis, top: 0.0, friction, velocity, moved: false, listed: false }
    }

    /// Distance of the outline's corners from the centre, m.
    pub fn extent_m(&self) -> f64 {
        self.half.norm()
    }

    /// Rotates a vector from the world's horizontal plane to the box's axes.
    #[inline]
    fn local(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.axis.dot(&v), self.axis.x * v.y - self.axis.y * v.x)
    }

    #[inline]
    fn world(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.axis.x * v.x - self.axis.y * v.y, self.axis.y * v.x + self.axis.x * v.y)
    }

    /// Whether the outlines of two blocks overlap (separating axes).
    pub fn overlaps(&self, other: &TerrainBlock) -> bool {
        let separated = |a: &TerrainBlock, b: &TerrainBlock| {
            let center = a.local(b.center - a.center);
            let axis = a.local(b.axis);
            let reach = Vector2::new(
                (axis.x * b.half.x).abs() + (axis.y * b.half.y).abs(),
                (axis.y * b.half.x).abs() + (axis.x * b.half.y).abs(),
            );
            center.x.abs() >= a.half.x + reach.x || center.y.abs() >= a.half.y + reach.y
        };
        !separated(self, other) && !separated(other, self)
    }

    /// Gap (m, negative inside) and normal (world, out of the box) between a sphere and this box, if nearer than `reach` (m).
    /// `center` is that of the sphere, world, m; `radius` its radius, m.
    pub fn nearest(&self, center: &Vector3<f64>, radius: f64, reach: f64) -> Option<(f64, Vector3<f64>)> {
        let p = self.local(center.xy() - self.center);
        let outside = Vector2::new(p.x.abs() - self.half.x, p.y.abs() - self.half.y);
        let above = center.z - self.top;
        let far = radius + reach;
        if outside.x > far || outside.y > far || above > far {
            return None;
        }
        let sideways = |v: Vector2<f64>| {
            let w = self.world(v);
            Vector3::new(w.x, w.y, 0.0)
        };
        let out_x = sideways(Vector2::new(1.0_f64.copysign(p.x), 0.0));
        let out_y = sideways(Vector2::new(0.0, 1.0_f64.copysign(p.y)));
        if outside.x <= 0.0 && outside.y <= 0.0 && above <= 0.0 {
            // The centre is inside: the normal of the nearest face.
            let nearest = above.max(outside.x).max(outside.y);
            let normal = match nearest {
                n if n == above => Vector3::z(),
                n if n == outside.x => out_x,
                _ => out_y,
            };
            return Some((nearest - radius, normal));
        }
        let away = out_x * outside.x.max(0.0) + out_y * outside.y.max(0.0) + Vector3::z() * above.max(0.0);
        let distance = away.norm();
        (distance < far).then(|| (distance - radius, away / distance))
    }
}
