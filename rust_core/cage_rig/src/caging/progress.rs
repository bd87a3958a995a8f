//! How far a long piece of work is, told to whoever waits for it, who may stop it.

use crate::error::CagingError;

/// Asked at every step with the stage's name and the part of it done, 0 to 1; false stops the work.
pub type Listener<'a> = dyn Fn(&'static str, f64) -> bool + Sync + 'a;

/// Handed through every long stage.
#[derive(Clone, Copy)]
pub struct Progress<'a> {
    listener: Option<&'a Listener<'a>>,
}

impl<'a> Progress<'a> {
    /// Tells `listener`.
    pub fn new(listener: &'a Listener<'a>) -> Self {
        Self { listener: Some(listener) }
    }

    /// Tells nobody.
    pub fn silent() -> Self {
        Self { listener: None }
    }

    /// `part` of `stage` is done. [`CagingError::Cancelled`] when the listener wants no more.
    pub fn step(&self, stage: &'static str, part: f64) -> Result<(), CagingError> {
        match self.listener {
            Some(listener) if !listener(stage, part) => Err(CagingError::Cancelled),
            _ => Ok(()),
        }
    }
}
