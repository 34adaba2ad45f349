//! Where the nodes of a compact material are.

use crate::error::Error;

/// Steps of each axis of the fine grid, on which nodes lie: from θ = 0 to 90°, and over the range of φ_d.
pub const FINE: u8 = 180;
/// What a file can hold.
pub const MOST_BANDS: usize = 16;
pub const MOST_NODES: usize = 1 << 17;

/// Places of nodes on the fine grid. Nodes of equal θ_h are a row; rows are in bands, and all rows of a band have the same places in
/// θ_d and φ_d. Nodes are counted row by row, then by θ_d, then by φ_d.
///
/// The range of φ_d is 360°, half of that if the lattice is reciprocal, and again half if it is mirrored.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeLattice {
    /// The place of each row: increasing from 0 to `FINE`.
    pub theta_h: Vec<u8>,
    /// The band of each row.
    pub band: Vec<u8>,
    /// For each band, places that increase from 0 to `FINE`.
    pub theta_d: Vec<Vec<u8>>,
    /// For each band, places that increase from 0: they end before `FINE`, where the first node comes again; or, if the lattice is
    /// mirrored, at `FINE`, but for 0 alone, of what is constant in φ_d.
    pub phi_d: Vec<Vec<u8>>,
    /// Whether both orders of the directions, φ_d and φ_d + 180°, give the same.
    pub reciprocal: bool,
    /// Whether φ_d and −φ_d give the same.
    pub mirrored: bool,
}

impl NodeLattice {
    /// Whether all axes are as the fields say, each row has a band and each band has a row. The other functions may panic if not.
    pub fn is_valid(&self) -> bool {
        let NodeLattice { theta_h, band, theta_d, phi_d, mirrored, .. } = self;
        let closed = |axis: &Vec<u8>| increases(axis) && axis.len() > 1 && axis[axis.len() - 1] == FINE;
        let open = |axis: &Vec<u8>| increases(axis) && axis[axis.len() - 1] < FINE;
        closed(theta_h)
            && theta_d.iter().all(closed)
            && phi_d.iter().all(|axis| if *mirrored { closed(axis) || axis == &[0] } else { open(axis) })
            && theta_d.len() == phi_d.len()
            && band.len() == theta_h.len()
            && band.iter().all(|&b| usize::from(b) < theta_d.len())
            && (0..theta_d.len()).all(|b| band.iter().any(|&other| usize::from(other) == b))
    }

    /// Whether a file can hold the lattice: it is valid, not too large, and its bands are in order. Gives `Error::Lattice` if not.
    pub fn check(&self) -> Result<(), Error> {
        let fits = self.theta_d.len() <= MOST_BANDS && self.band.is_sorted();
        if fits && self.is_valid() && self.nodes() <= MOST_NODES { Ok(()) } else { Err(Error::Lattice) }
    }

    /// The number of nodes in a row.
    pub fn nodes_in(&self, row: usize) -> usize {
        let band = usize::from(self.band[row]);
        self.theta_d[band].len() * self.phi_d[band].len()
    }

    /// The number of places in φ_d of a row.
    pub fn width(&self, row: usize) -> usize {
        self.phi_d[usize::from(self.band[row])].len()
    }

    /// The number of all nodes.
    pub fn nodes(&self) -> usize {
        (0..self.band.len()).map(|row| self.nodes_in(row)).sum()
    }
}

fn increases(axis: &[u8]) -> bool {
    axis.first() == Some(&0) && axis.is_sorted_by(|a, b| a < b)
}
