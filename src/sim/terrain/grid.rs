//! A uniform grid over the centres of the blocks: finds the blocks near a point without a look at all of them.
//!
//! Every block is in the cell of its centre; a search covers the cells within the largest distance of an outline's corner
//! from its centre. The cells' lists are linked through the blocks, so that a block changes its cell without an allocation.
//! A centre outside the grid counts as one in the nearest cell at the border.

use nalgebra::Vector2;

/// Most cells along one side of the grid.
const MOST_CELLS: f64 = 256.0;
/// Enlargement of a search: the distance to a block is rounded, m.
const ROUNDING_M: f64 = 1e-9;
/// Index that stands for no block.
const NONE: u32 = u32::MAX;

/// Place of a block in the list of its cell.
#[derive(Debug, Clone, Copy)]
struct GridLink {
    cell: u32,
    next: u32,
    previous: u32,
}

/// The blocks by the cell of their centre.
#[derive(Debug, Clone)]
pub(super) struct BlockGrid {
    /// Corner with the smallest coordinates, m.
    origin: Vector2<f64>,
    /// Cells per metre.
    per_metre: f64,
    cells: [usize; 2],
    /// First block of each cell, row by row along x.
    first: Vec<u32>,
    links: Vec<GridLink>,
    /// Largest distance of a corner of a block from its centre, m.
    extent_m: f64,
}

impl BlockGrid {
    /// A grid over `area` ([x from, x to, y from, y to], m) for at most `capacity` blocks with edges of about `edge_m`.
    pub fn new(area: [f64; 4], edge_m: f64, capacity: usize) -> BlockGrid {
        let [x_from, x_to, y_from, y_to] = area;
        let size = Vector2::new(x_to - x_from, y_to - y_from);
        // Half an edge: of the cells that a foot's search covers, few blocks are too far away.
        let cell_m = (0.5 * edge_m).max(size.max() / MOST_CELLS);
        let cells = [size.x, size.y].map(|side| (side / cell_m).ceil().clamp(1.0, MOST_CELLS) as usize);
        BlockGrid {
            origin: Vector2::new(x_from, y_from),
            per_metre: 1.0 / cell_m,
            cells,
            first: vec![NONE; cells[0] * cells[1]],
            links: Vec::with_capacity(capacity),
            extent_m: 0.0,
        }
    }

    /// Removes all blocks.
    pub fn clear(&mut self) {
        self.first.fill(NONE);
        self.links.clear();
        self.extent_m = 0.0;
    }

    /// Adds the next block, whose corners are `extent_m` from its centre.
    pub fn push(&mut self, center: &Vector2<f64>, extent_m: f64) {
        self.extent_m = self.extent_m.max(extent_m);
        let block = self.links.len();
        self.links.push(GridLink { cell: 0, next: NONE, previous: NONE });
        self.insert(block, self.cell_of(center));
    }

    /// Moves block `block`, whose centre has changed, to its cell.
    pub fn relocate(&mut self, block: usize, center: &Vector2<f64>) {
        let cell = self.cell_of(center);
        let GridLink { cell: old, next, previous } = self.links[block];
        if cell == old as usize {
            return;
        }
        match previous {
            NONE => self.first[old as usize] = next,
            previous => self.links[previous as usize].next = next,
        }
        if next != NONE {
            self.links[next as usize].previous = previous;
        }
        self.insert(block, cell);
    }

    fn insert(&mut self, block: usize, cell: usize) {
        let next = self.first[cell];
        if next != NONE {
            self.links[next as usize].previous = block as u32;
        }
        self.links[block] = GridLink { cell: cell as u32, next, previous: NONE };
        self.first[cell] = block as u32;
    }

    /// Calls `visit` with every block whose outline can be within `distance_m` (0 or more) of `point`, and with others, in no
    /// order.
    #[inline]
    pub fn near(&self, point: &Vector2<f64>, distance_m: f64, mut visit: impl FnMut(usize)) {
        let far = distance_m + self.extent_m + ROUNDING_M;
        let range = |axis: usize| [-far, far].map(|offset| self.coordinate(axis, point[axis] + offset));
        let ([x_from, x_to], [y_from, y_to]) = (range(0), range(1));
        for y in y_from..=y_to {
            let row = y * self.cells[0];
            for &first in &self.first[row + x_from..=row + x_to] {
                let mut block = first;
                while block != NONE {
                    visit(block as usize);
                    block = self.links[block as usize].next;
                }
            }
        }
    }

    fn cell_of(&self, center: &Vector2<f64>) -> usize {
        self.coordinate(1, center.y) * self.cells[0] + self.coordinate(0, center.x)
    }

    /// Column or row of a coordinate; monotonic, so that a search misses no block outside the grid.
    #[inline]
    fn coordinate(&self, axis: usize, value: f64) -> usize {
        // A negative number and one that is no number become zero.
        (((value - self.origin[axis]) * self.per_metre) as usize).min(self.cells[axis] - 1)
    }
}
