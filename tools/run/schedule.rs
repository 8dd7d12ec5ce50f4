//! The schedule of a training run: after which steps it is scored, saved and timed.

/// Steps whose passes are timed.
const PROFILED: u64 = 5;

#[derive(clap::Args)]
pub struct ScheduleArgs {
    /// Steps between checkpoints: the most that a lost device can cost. By default a tenth of the run.
    #[arg(long)]
    checkpoint_every: Option<u64>,
    /// Steps between evaluations of some test images; 0 for none. By default a tenth of the run.
    #[arg(long)]
    eval_every: Option<u64>,
    /// Also evaluate after these steps, separated by commas.
    #[arg(long, value_delimiter = ',')]
    eval_at: Vec<u64>,
    /// Test images of such an evaluation, spread evenly over all. The end of the run evaluates all.
    #[arg(long, default_value_t = 16)]
    pub eval_images: usize,
    /// At the end, fit the time offset of every test camera to its own images, and score them at these offsets too.
    #[arg(long)]
    pub fit_offsets: bool,
}

pub struct Schedule<'a> {
    total: u64,
    eval_every: u64,
    eval_at: &'a [u64],
    checkpoint_every: u64,
}

impl<'a> Schedule<'a> {
    pub fn new(args: &'a ScheduleArgs, total: u64) -> Self {
        let tenth = (total / 10).max(1);
        Schedule {
            total,
            eval_every: args.eval_every.unwrap_or(tenth),
            eval_at: &args.eval_at,
            checkpoint_every: args.checkpoint_every.unwrap_or(tenth).max(1),
        }
    }

    /// False for the last step: all test images are scored after it.
    pub fn is_evaluation_due(&self, step: u64) -> bool {
        let is_periodic = self.eval_every > 0 && step.is_multiple_of(self.eval_every);
        step != self.total && (is_periodic || self.eval_at.contains(&step))
    }

    pub fn is_checkpoint_due(&self, step: u64) -> bool {
        step == self.total || step.is_multiple_of(self.checkpoint_every)
    }

    /// True for the step in the middle of each fifth of the run.
    pub fn is_profile_due(&self, step: u64) -> bool {
        (0..PROFILED).any(|k| step == ((2 * k + 1) * self.total / (2 * PROFILED)).max(1))
    }
}
