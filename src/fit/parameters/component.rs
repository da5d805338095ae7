//! Components: groups of trials whose parameters can be estimated independently of all other trials.
//!
//! Within a component, the coordinates of a single trial or condition form a block; coordinates that several blocks share form the
//! border. The Gauss-Newton matrix then has the shape of an arrowhead: diagonal blocks, and the rows and columns of the border.

use nalgebra::{DMatrix, DVector};

/// A component: trials that share coordinates with each other and with no other trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Component {
    /// Indices of its trials.
    pub trials: Vec<usize>,
    /// For each block, the indices of its coordinates.
    pub blocks: Vec<Vec<usize>>,
    /// For each of `trials`, the index of its block.
    pub block_of_trial: Vec<usize>,
    /// Indices of the coordinates that several blocks share.
    pub border: Vec<usize>,
    /// Information about the border from trials outside the component; `None` if there is none.
    pub border_prior: Option<BorderPrior>,
}

/// A quadratic approximation of a cost over the border's coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct BorderPrior {
    /// Coordinates of the border at which the cost was approximated.
    pub at: DVector<f64>,
    /// Gradient of the cost there.
    pub gradient: DVector<f64>,
    /// Second derivatives of the cost.
    pub information: DMatrix<f64>,
}

/// Position of a coordinate in the normal equations of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// Position among the coordinates of the block in question.
    Block(usize),
    /// Position among the coordinates of the border.
    Border(usize),
}

impl Component {
    /// Indices of all coordinates in the order of the normal equations: block after block, then the border.
    pub fn order(&self) -> Vec<usize> {
        self.blocks.iter().flatten().chain(&self.border).copied().collect()
    }

    /// Trials of one block.
    pub fn trials_of_block(&self, block: usize) -> impl Iterator<Item = usize> {
        let with_block = self.trials.iter().zip(&self.block_of_trial);
        with_block.filter(move |(_, of)| **of == block).map(|(trial, _)| *trial)
    }

    /// Position of a coordinate in `block` or in the border; `None` if it is in neither.
    pub fn position(&self, block: usize, coordinate: usize) -> Option<Position> {
        let position_in = |coordinates: &[usize]| coordinates.iter().position(|own| *own == coordinate);
        match position_in(&self.blocks[block]) {
            Some(position) => Some(Position::Block(position)),
            None => position_in(&self.border).map(Position::Border),
        }
    }
}
