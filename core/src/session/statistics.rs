//! What a session has learned of the scene, to be saved or loaded.

use super::SessionState;
use crate::learn::cache::{Cache, CacheError};
use crate::learn::guiding::Guide;
use crate::learn::saved;

impl<'m> SessionState<'m> {
    /// Length of what [`Self::save_statistics`] writes, bytes; 0 if the session learns nothing of the scene.
    pub fn saved_statistics_len(&self) -> usize {
        saved::saved_len(self.cache(), self.guide())
    }

    /// Writes what was learned of the scene, statistics and distributions of path guiding, for another run, another
    /// machine, another scene of the same bounds; returns the bytes written. They are the same on every machine.
    /// Between the pieces of an iteration's end they hold a part of what it taught.
    ///
    /// # Errors
    /// [`CacheError::Absent`] if the session learns nothing of the scene, [`CacheError::Length`] if there is too little
    /// room.
    pub fn save_statistics(&self, out: &mut [u8]) -> Result<usize, CacheError> {
        saved::save(self.cache(), self.guide(), out)
    }

    /// Replaces what was learned of the scene by saved bytes; a guide with less room takes what fits, and whether
    /// guiding pays is open again. Whatever is loaded changes efficiency only. After an error all is as before.
    ///
    /// # Errors
    /// Bytes that are damaged, or of another scene or objective; [`CacheError::Absent`] if they hold nothing that this
    /// session learns, or an iteration runs.
    pub fn load_statistics(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        let (cache, guide) = self.changed_statistics();
        saved::load(cache, guide, bytes)?;
        self.learned.forget_gain();
        Ok(())
    }

    /// Adds saved bytes to what was learned of the scene, and as much of their detail as there is room for.
    ///
    /// # Errors
    /// Those of [`Self::load_statistics`].
    pub fn merge_statistics(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        let (cache, guide) = self.changed_statistics();
        saved::merge(cache, guide, bytes)
    }

    fn changed_statistics(&mut self) -> (Option<&mut Cache<'m>>, Option<&mut Guide<'m>>) {
        if self.running { (None, None) } else { self.learned.of_scene_mut() }
    }
}
