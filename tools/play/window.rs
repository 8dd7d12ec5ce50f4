//! The window: events, frames, and what is shown.

use super::controls::{Clock, Push, Rig};
use super::overlay::{Bar, Frames, bar_height, draw, track};
use super::sound::{Heard, Sound};
use crate::interrupt::{Interrupted, Stop};
use crate::screen::say;
use anyhow::Context;
use glam::{DVec2, DVec3};
use ivv::gpu::Window as Shown;
use ivv::scene::{Frame, View};
use ivv::sound::pose::Pose;
use ivv::stage::{Layer, Renderer, Screen};
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Fullscreen, Window, WindowId};

/// How long a window that took no picture is left alone, and how often the end that was asked for is looked for.
const GLANCE: Duration = Duration::from_millis(50);
/// What a window fits in that nobody gave a size, pixels.
const USUAL: [u32; 2] = [1280, 720];
const SPEEDS: [f64; 6] = [0.1, 0.25, 0.5, 1.0, 1.5, 2.0];

/// What is shown of a picture.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
pub enum Output {
    Color,
    Alpha,
    Depth,
    Flow,
}

const OUTPUTS: [Output; 4] = [Output::Color, Output::Alpha, Output::Depth, Output::Flow];

/// When it ends by itself, and what is written then.
#[derive(Default)]
pub struct Shot {
    pub frames: Option<u64>,
    pub file: Option<PathBuf>,
}

/// What is open while the window is.
struct Open {
    window: Arc<Window>,
    shown: Shown,
    screen: Option<Screen>,
}

/// All that plays.
pub struct Player {
    pub output: Output,
    pub has_stats: bool,
    pub shot: Shot,
    pub is_synced: bool,
    pub size: Option<[u32; 2]>,
    pub sound: Option<Sound>,
    /// Index of the view that was gone to last.
    pub current: usize,
    renderer: Renderer,
    rig: Rig,
    views: Vec<View>,
    clock: Clock,
    flow_dt: f64,
    is_muted: bool,
    open: Option<Open>,
    frames: Frames,
    /// Frames that the window took.
    n_frames: u64,
    last: Option<Instant>,
    keys: HashSet<KeyCode>,
    button: Option<MouseButton>,
    pointer: DVec2,
    is_scrubbing: bool,
    is_dirty: bool,
    is_hidden: bool,
    is_stopped: bool,
    fault: Option<anyhow::Error>,
}

impl Player {
    /// One that begins at the rig's view and the clock's time; `flow_dt` is a frame of the clip in normalised time.
    pub fn new(renderer: Renderer, rig: Rig, views: Vec<View>, clock: Clock, flow_dt: f64) -> Self {
        Player {
            output: Output::Color,
            has_stats: false,
            shot: Shot::default(),
            is_synced: true,
            size: None,
            sound: None,
            current: 0,
            renderer,
            rig,
            views,
            clock,
            flow_dt,
            is_muted: false,
            open: None,
            frames: Frames::default(),
            n_frames: 0,
            last: None,
            keys: HashSet::new(),
            button: None,
            pointer: DVec2::ZERO,
            is_scrubbing: false,
            is_dirty: true,
            is_hidden: false,
            is_stopped: false,
            fault: None,
        }
    }

    /// Plays until the window is closed.
    ///
    /// # Errors
    /// What ended it otherwise: the device's faults, or an interruption.
    pub fn run(mut self, events: EventLoop<()>, stop: &Stop) -> anyhow::Result<()> {
        struct Watched<'a>(&'a mut Player, &'a Stop);
        impl ApplicationHandler for Watched<'_> {
            fn resumed(&mut self, events: &ActiveEventLoop) {
                let opened = self.0.open(events);
                self.0.judge(opened, events);
            }
            fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
                let done = self.0.event(event, events);
                self.0.judge(done, events);
            }
            fn about_to_wait(&mut self, events: &ActiveEventLoop) {
                self.0.is_stopped = self.1.is_asked();
                if self.0.is_stopped {
                    events.exit();
                }
                self.0.wait(events);
            }
        }
        events.run_app(&mut Watched(&mut self, stop)).context("the window's events ended")?;
        match self.fault {
            Some(fault) => Err(fault),
            None if self.is_stopped => Err(Interrupted("the window is closed").into()),
            None => Ok(()),
        }
    }

    fn judge(&mut self, done: anyhow::Result<()>, events: &ActiveEventLoop) {
        if let Err(fault) = done {
            self.fault = Some(fault);
            events.exit();
        }
    }

    fn open(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let [width, height] = self.size.unwrap_or_else(|| {
            let [w, h] = self.views.first().map_or(USUAL, |view| [view.width, view.height]);
            let [w, h] = [w, h].map(f64::from);
            let zoom = (f64::from(USUAL[0]) / w).min(f64::from(USUAL[1]) / h);
            [w, h].map(|side| ((side * zoom).round() as u32).max(1))
        });
        let wanted = Window::default_attributes().with_title("ivv").with_inner_size(PhysicalSize::new(width, height));
        let window = Arc::new(events.create_window(wanted).context("no window can be opened")?);
        let shown = Shown::new(self.renderer.gpu(), window.clone(), self.is_synced)?;
        self.open = Some(Open { window, shown, screen: None });
        Ok(())
    }

    /// Asks for the next frame, or waits until there is something new to show.
    fn wait(&mut self, events: &ActiveEventLoop) {
        let is_moving = self.clock.is_playing || self.has_stats || self.shot.frames.is_some() || !self.keys.is_empty();
        let Some(open) = &self.open else { return };
        if (is_moving || self.is_dirty) && !self.is_hidden {
            open.window.request_redraw();
        }
        events.set_control_flow(ControlFlow::WaitUntil(Instant::now() + GLANCE));
    }

    fn event(&mut self, event: WindowEvent, events: &ActiveEventLoop) -> anyhow::Result<()> {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => self.frame(events)?,
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => self.is_dirty = true,
            WindowEvent::Occluded(is_hidden) => (self.is_hidden, self.is_dirty) = (is_hidden, true),
            WindowEvent::Focused(false) => self.keys.clear(),
            WindowEvent::KeyboardInput { event, .. } => {
                let PhysicalKey::Code(key) = event.physical_key else { return Ok(()) };
                if event.state == ElementState::Released {
                    self.keys.remove(&key);
                } else if is_held(key) {
                    self.keys.insert(key);
                } else if !event.repeat {
                    self.key(key, events);
                }
                self.is_dirty = true;
            }
            WindowEvent::MouseInput { state, button, .. } => {
                self.button = (state == ElementState::Pressed).then_some(button);
                self.is_scrubbing = self.button == Some(MouseButton::Left) && self.is_on_bar();
                self.scrub();
            }
            WindowEvent::CursorMoved { position, .. } => {
                let by = DVec2::new(position.x, position.y) - self.pointer;
                self.pointer += by;
                self.drag(by);
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let pixels = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => -48.0 * f64::from(lines),
                    MouseScrollDelta::PixelDelta(by) => -by.y,
                };
                self.rig.approach((pixels.clamp(-200.0, 200.0) * 0.0015).exp());
                self.is_dirty = true;
            }
            _ => {}
        }
        Ok(())
    }

    fn pixels(&self) -> [u32; 2] {
        self.open.as_ref().map_or([1, 1], |open| open.window.inner_size().into())
    }

    /// Pixels of a point of the overlay.
    fn scale(&self) -> usize {
        self.open.as_ref().map_or(1.0, |open| open.window.scale_factor()).round().clamp(1.0, 8.0) as usize
    }

    fn has_bar(&self) -> bool {
        self.clock.length > 0.0 && (self.shot.file.is_none() || self.has_stats)
    }

    fn is_on_bar(&self) -> bool {
        self.has_bar() && self.pointer.y >= f64::from(self.pixels()[1]) - bar_height(self.scale()) as f64
    }

    fn scrub(&mut self) {
        if self.is_scrubbing {
            let [from, to] = track(self.pixels()[0] as usize, self.scale()).map(|x| x as f64);
            let share = ((self.pointer.x - from) / (to - from).max(1.0)).clamp(0.0, 1.0);
            self.seek(share * self.clock.length);
        }
    }

    fn drag(&mut self, by: DVec2) {
        let is_shifted = self.is_pressed(KeyCode::ShiftLeft);
        match self.button {
            _ if self.is_scrubbing => self.scrub(),
            Some(MouseButton::Left) if !is_shifted => self.rig.drag(by),
            Some(_) => self.rig.pan(by, self.pixels()),
            None => return,
        }
        self.is_dirty = true;
    }

    fn is_pressed(&self, key: KeyCode) -> bool {
        self.keys.contains(&key)
    }

    fn seek(&mut self, time: f64) {
        self.clock.set(time, self.clock.is_playing, self.clock.speed);
        self.is_dirty = true;
    }

    fn go(&mut self, view: usize) {
        if let Some(found) = self.views.get(view) {
            self.current = view;
            self.rig.go(found);
        }
    }

    fn key(&mut self, key: KeyCode, events: &ActiveEventLoop) {
        let (now, clock, n) = (self.clock.at(Instant::now()), self.clock, self.views.len().max(1));
        let frame = self.flow_dt * clock.length;
        let speed = SPEEDS.iter().position(|speed| *speed == clock.speed).unwrap_or(3);
        let faster = |by: isize| SPEEDS[speed.saturating_add_signed(by).min(SPEEDS.len() - 1)];
        match key {
            KeyCode::Space => self.clock.set(now, !clock.is_playing, clock.speed),
            KeyCode::Minus => self.clock.set(now, clock.is_playing, faster(-1)),
            KeyCode::Equal => self.clock.set(now, clock.is_playing, faster(1)),
            KeyCode::Home => self.seek(0.0),
            KeyCode::KeyJ => self.seek(now - 1.0),
            KeyCode::KeyL => self.seek(now + 1.0),
            KeyCode::Comma => self.seek(now - frame),
            KeyCode::Period => self.seek(now + frame),
            KeyCode::BracketLeft => self.go((self.current + n - 1) % n),
            KeyCode::BracketRight | KeyCode::KeyV => self.go((self.current + 1) % n),
            KeyCode::KeyR => self.go(0),
            KeyCode::KeyO => self.output = OUTPUTS[(self.output as usize + 1) % OUTPUTS.len()],
            KeyCode::F1 => self.output = Output::Color,
            KeyCode::F2 => self.output = Output::Alpha,
            KeyCode::F3 => self.output = Output::Depth,
            KeyCode::F4 => self.output = Output::Flow,
            KeyCode::KeyG => self.rig.is_flying = !self.rig.is_flying,
            KeyCode::KeyM => self.is_muted = !self.is_muted,
            KeyCode::KeyI => (self.has_stats, self.frames) = (!self.has_stats, Frames::default()),
            KeyCode::KeyF => self.fill_the_display(),
            KeyCode::Escape => events.exit(),
            key => {
                let digits = [
                    KeyCode::Digit1,
                    KeyCode::Digit2,
                    KeyCode::Digit3,
                    KeyCode::Digit4,
                    KeyCode::Digit5,
                    KeyCode::Digit6,
                    KeyCode::Digit7,
                    KeyCode::Digit8,
                    KeyCode::Digit9,
                ];
                if let Some(view) = digits.iter().position(|digit| *digit == key) {
                    self.go(view);
                }
            }
        }
    }

    fn fill_the_display(&self) {
        if let Some(Open { window, .. }) = &self.open {
            let full = window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
            window.set_fullscreen(full);
        }
    }

    fn push(&self) -> Push {
        let axis = |less: KeyCode, more: KeyCode| f64::from(self.is_pressed(more)) - f64::from(self.is_pressed(less));
        Push {
            shift: DVec3::new(
                axis(KeyCode::KeyA, KeyCode::KeyD),
                axis(KeyCode::KeyE, KeyCode::KeyQ),
                axis(KeyCode::KeyS, KeyCode::KeyW),
            ),
            turn: DVec2::new(axis(KeyCode::ArrowLeft, KeyCode::ArrowRight), axis(KeyCode::ArrowUp, KeyCode::ArrowDown)),
            is_fast: self.is_pressed(KeyCode::ShiftLeft),
        }
    }

    /// What the sound has to know.
    pub fn heard(&self) -> Heard {
        let turn = Pose::looking(self.rig.forward(), self.rig.above());
        Heard { clock: self.clock, place: self.rig.center(), turn, is_muted: self.is_muted }
    }

    fn layer(&self, width: u32) -> Layer {
        match self.output {
            Output::Color => Layer::Color,
            Output::Alpha => Layer::Alpha,
            // What is looked at is in the middle of the colours, and a hundredth of the picture is a fast motion.
            Output::Depth => Layer::Depth { high: (2.0 / self.rig.reach) as f32 },
            Output::Flow => Layer::Flow { high: width as f32 / 100.0 },
        }
    }

    fn frame(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let now = Instant::now();
        let between = self.last.map(|last| (now - last).as_secs_f64());
        self.rig.advance(self.push(), between.unwrap_or_default().min(0.1));
        if let Some(sound) = &self.sound {
            sound.tell(self.heard());
        }
        let Some(mut open) = self.open.take() else { return Ok(()) };
        let is_shown = self.draw(&mut open, now, between.map(|seconds| 1e3 * seconds));
        let is_shown =
            is_shown.and_then(|is_shown| if is_shown { self.count(&open, events) } else { Ok(()) }.map(|()| is_shown));
        self.open = Some(open);
        self.is_dirty = !is_shown?;
        // The time of a window that stands still is no frame's.
        self.last = (!self.is_dirty).then_some(now);
        Ok(())
    }

    /// Draws a frame and shows it; `false` where the window took it not.
    fn draw(&mut self, open: &mut Open, now: Instant, between: Option<f64>) -> anyhow::Result<bool> {
        let gpu = self.renderer.gpu().clone();
        let Some(size) = open.shown.fit(open.window.inner_size().into())? else { return Ok(false) };
        let [width, height] = size;
        let is_fit = |screen: &Screen| (screen.width, screen.height) == (width, height);
        let mut screen = match open.screen.take().filter(is_fit) {
            Some(screen) => screen,
            None => Screen::new(&gpu, width, height, open.shown.is_bgra())?,
        };
        let seconds = self.clock.at(now);
        let time = if self.clock.length > 0.0 { seconds / self.clock.length } else { 0.0 };
        let view = View { time, time_offset: 0.0, flow_dt: self.flow_dt, ..self.rig.view(size) };
        let name = self.views.get(self.current).map_or("", |view| &view.name);
        let text =
            format!("{:?}  x{}  {name}{}", self.output, self.clock.speed, if self.is_muted { "  muted" } else { "" });
        let Clock { length, is_playing, .. } = self.clock;
        let bar = self.has_bar().then_some(Bar { seconds, length, is_playing, text: &text });
        let stats = self.has_stats.then_some(&self.frames);
        let scale = open.window.scale_factor().round().clamp(1.0, 8.0) as usize;
        screen.lay(&gpu, &draw(size.map(|side| side as usize), scale, bar.as_ref(), stats))?;
        let begun = Instant::now();
        let report = self.renderer.show(&view, self.layer(width), &screen, self.has_stats)?;
        self.frames.add(1e3 * begun.elapsed().as_secs_f64(), between, report);
        let is_shown = open.shown.present(&screen.pixels)?;
        open.screen = Some(screen);
        Ok(is_shown)
    }

    /// Counts a frame that was shown, and ends with the last one.
    fn count(&mut self, open: &Open, events: &ActiveEventLoop) -> anyhow::Result<()> {
        self.n_frames += 1;
        if self.shot.frames != Some(self.n_frames) {
            return Ok(());
        }
        if let (Some(file), Some(screen)) = (&self.shot.file, &open.screen) {
            let words = self.renderer.gpu().read(&screen.pixels)?;
            let color = words.into_iter().map(|word| {
                let [r, g, b, _] = word.to_le_bytes().map(|level| f32::from(level) / 255.0);
                if screen.is_bgra { [b, g, r] } else { [r, g, b] }
            });
            let frame =
                Frame { width: screen.width, height: screen.height, color: color.collect(), ..Frame::default() };
            frame.write_png(file)?;
            say!("{}: written", file.display());
        }
        events.exit();
        Ok(())
    }
}

/// Whether a key moves while it is held.
fn is_held(key: KeyCode) -> bool {
    matches!(
        key,
        KeyCode::KeyW
            | KeyCode::KeyA
            | KeyCode::KeyS
            | KeyCode::KeyD
            | KeyCode::KeyQ
            | KeyCode::KeyE
            | KeyCode::ArrowLeft
            | KeyCode::ArrowRight
            | KeyCode::ArrowUp
            | KeyCode::ArrowDown
            | KeyCode::ShiftLeft
    )
}
