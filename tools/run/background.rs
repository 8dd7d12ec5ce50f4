//! Work beside the training: on a GPU a tenth of a run may take less time than writing its checkpoint and its report.

use std::thread::{Scope, ScopedJoinHandle};

/// Runs both at once. If both fail, the error is that of the first.
pub fn in_parallel(
    first: impl FnOnce() -> ivv::Result<()> + Send,
    second: impl FnOnce() -> ivv::Result<()>,
) -> ivv::Result<()> {
    std::thread::scope(|scope| {
        let first = scope.spawn(first);
        let second = second();
        first.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).and(second)
    })
}

/// Writes one thing at a time, on a thread of its own.
pub struct BackgroundWriter<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    last: Option<ScopedJoinHandle<'scope, ivv::Result<()>>>,
}

impl<'scope, 'env> BackgroundWriter<'scope, 'env> {
    pub fn new(scope: &'scope Scope<'scope, 'env>) -> Self {
        BackgroundWriter { scope, last: None }
    }

    /// Starts `work` after the work before it has ended; if that failed, returns its error instead.
    pub fn start(&mut self, work: impl FnOnce() -> ivv::Result<()> + Send + 'scope) -> ivv::Result<()> {
        self.wait()?;
        self.last = Some(self.scope.spawn(work));
        Ok(())
    }

    /// Waits for the last work, and returns its error once.
    pub fn wait(&mut self) -> ivv::Result<()> {
        match self.last.take().map(ScopedJoinHandle::join) {
            None => Ok(()),
            Some(Ok(done)) => done,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}
