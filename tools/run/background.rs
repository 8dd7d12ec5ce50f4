//! What a run writes while it goes on: on a GPU a tenth of a run may take less time than its checkpoint and its report.

use std::thread::{Scope, ScopedJoinHandle};

/// Does both at once.
///
/// # Errors
/// That of the first, else that of the second.
pub fn both(
    first: impl FnOnce() -> ivv::Result<()> + Send,
    second: impl FnOnce() -> ivv::Result<()>,
) -> ivv::Result<()> {
    std::thread::scope(|scope| {
        let first = scope.spawn(first);
        let second = second();
        first.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).and(second)
    })
}

/// One piece of work at a time, on a thread of its own.
pub struct Behind<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    last: Option<ScopedJoinHandle<'scope, ivv::Result<()>>>,
}

impl<'scope, 'env> Behind<'scope, 'env> {
    pub fn new(scope: &'scope Scope<'scope, 'env>) -> Self {
        Behind { scope, last: None }
    }

    /// Begins `work` once the work before it is done.
    ///
    /// # Errors
    /// That of the work before it; `work` is then not begun.
    pub fn begin(&mut self, work: impl FnOnce() -> ivv::Result<()> + Send + 'scope) -> ivv::Result<()> {
        self.wait()?;
        self.last = Some(self.scope.spawn(work));
        Ok(())
    }

    /// Waits until all is done.
    ///
    /// # Errors
    /// That of the last work, once.
    pub fn wait(&mut self) -> ivv::Result<()> {
        match self.last.take().map(ScopedJoinHandle::join) {
            None => Ok(()),
            Some(Ok(done)) => done,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}
