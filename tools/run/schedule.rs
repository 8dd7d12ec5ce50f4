//! When a training run is scored, saved and timed.

/// Steps whose passes are timed.
const PROFILED: u64 = 5;

/// How often a run is saved and scored.
#[derive(clap::Args)]
pub struct DueArgs {
    /// Steps between checkpoints, which is the most that a lost device can cost. By default a tenth of the run.
    #[arg(long)]
    checkpoint_every: Option<u64>,
    /// Steps between evaluations of some test images; 0 for none. By default a tenth of the run.
    #[arg(long)]
    eval_every: Option<u64>,
    /// Also evaluates after these steps, separated by commas.
    #[arg(long, value_delimiter = ',')]
    eval_at: Vec<u64>,
    /// Test images of such an evaluation, spread evenly over all. The end of the run takes all.
    #[arg(long, default_value_t = 16)]
    pub eval_images: usize,
    /// At the end, fits the time offset of every test camera to its own images, and scores them at these offsets too.
    #[arg(long)]
    pub fit_offsets: bool,
}

/// What is due after which step.
pub struct Due<'a> {
    total: u64,
    eval_every: u64,
    eval_at: &'a [u64],
    checkpoint_every: u64,
}

impl<'a> Due<'a> {
    /// As `args` say, in a run of `total` steps.
    pub fn new(args: &'a DueArgs, total: u64) -> Self {
        let tenth = (total / 10).max(1);
        Due {
            total,
            eval_every: args.eval_every.unwrap_or(tenth),
            eval_at: &args.eval_at,
            checkpoint_every: args.checkpoint_every.unwrap_or(tenth).max(1),
        }
    }

    /// The last step has an evaluation of its own, of all test images.
    pub fn evaluation(&self, step: u64) -> bool {
        let is_periodic = self.eval_every > 0 && step.is_multiple_of(self.eval_every);
        step != self.total && (is_periodic || self.eval_at.contains(&step))
    }

    pub fn checkpoint(&self, step: u64) -> bool {
        step == self.total || step.is_multiple_of(self.checkpoint_every)
    }

    /// In the middle of each fifth of the run.
    pub fn profile(&self, step: u64) -> bool {
        (0..PROFILED).any(|k| step == ((2 * k + 1) * self.total / (2 * PROFILED)).max(1))
    }
}
