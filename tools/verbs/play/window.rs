//! The window: events, frames, and what is shown.

use super::Args;
use super::controls::{Clock, Navigator, Push};
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
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::KeyCode::{self, *};
use winit::keyboard::PhysicalKey;
use winit::window::{Fullscreen, Window, WindowId};

/// How often the end that was asked for is looked for, and how long a window that took no picture is left alone.
const GLANCE: Duration = Duration::from_millis(50);
const RETRY: Duration = Duration::from_millis(10);
/// What a window fits in that nobody gave a size, pixels.
const USUAL: [u32; 2] = [1280, 720];
const SPEEDS: [f64; 6] = [0.1, 0.25, 0.5, 1.0, 1.5, 2.0];

/// What is shown of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, clap::ValueEnum)]
pub enum Output {
    #[default]
    Color,
    Alpha,
    Depth,
    Flow,
}

/// Keys that move while they are held.
const HELD: [KeyCode; 11] = [KeyW, KeyA, KeyS, KeyD, KeyQ, KeyE, ArrowLeft, ArrowRight, ArrowUp, ArrowDown, ShiftLeft];

const OUTPUTS: [Output; 4] = [Output::Color, Output::Alpha, Output::Depth, Output::Flow];

/// What is open while the window is.
struct Open {
    window: Arc<Window>,
    shown: Shown,
    screen: Option<Screen>,
}

/// What keys and pointer do just now.
#[derive(Default)]
struct Hands {
    keys: HashSet<KeyCode>,
    button: Option<MouseButton>,
    pointer: DVec2,
    is_scrubbing: bool,
}

/// What plays.
pub struct Player<'a> {
    pub args: &'a Args,
    pub stop: &'a Stop,
    pub renderer: Renderer,
    pub rig: Navigator,
    pub views: Vec<View>,
    /// Index of the view that was gone to last.
    pub current: usize,
    pub clock: Clock,
    /// A frame of the clip, in normalised time.
    pub flow_dt: f64,
    pub sound: Option<Sound>,
    pub state: State,
}

/// What changes while it plays.
#[derive(Default)]
pub struct State {
    output: Output,
    has_stats: bool,
    is_muted: bool,
    open: Option<Open>,
    frames: Frames,
    /// Frames that the window took.
    n_frames: u64,
    last: Option<Instant>,
    hands: Hands,
    /// Whether what is shown is up to date.
    is_shown: bool,
    /// When the window, which took no picture, is given one again.
    retry: Option<Instant>,
    is_hidden: bool,
    fault: Option<anyhow::Error>,
}

impl ApplicationHandler for Player<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let opened = self.open(events);
        self.judge(opened, events);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let done = self.event(event, events);
        self.judge(done, events);
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if self.stop.is_asked() {
            events.exit();
        }
        self.wait(events);
    }
}

impl Player<'_> {
    /// Plays until the window is closed.
    ///
    /// # Errors
    /// What ended it otherwise: the device's faults, or an interruption.
    pub fn run(mut self, events: EventLoop<()>) -> anyhow::Result<()> {
        self.state = State { output: self.args.output, has_stats: self.args.stats, ..State::default() };
        events.run_app(&mut self).context("the window's events ended")?;
        match self.state.fault {
            Some(fault) => Err(fault),
            None if self.stop.is_asked() => Err(Interrupted("the window is closed").into()),
            None => Ok(()),
        }
    }

    fn judge(&mut self, done: anyhow::Result<()>, events: &ActiveEventLoop) {
        if let Err(fault) = done {
            self.state.fault = Some(fault);
            events.exit();
        }
    }

    fn open(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let [width, height] = self.args.size.unwrap_or_else(|| {
            let [w, h] = self.views.first().map_or(USUAL, |view| [view.width, view.height]);
            let [w, h] = [w, h].map(f64::from);
            let zoom = (f64::from(USUAL[0]) / w).min(f64::from(USUAL[1]) / h);
            [w, h].map(|side| ((side * zoom).round() as u32).max(1))
        });
        let wanted = Window::default_attributes().with_title("ivv").with_inner_size(PhysicalSize::new(width, height));
        let window = Arc::new(events.create_window(wanted).context("no window can be opened")?);
        let shown = Shown::new(self.renderer.gpu(), window.clone(), !self.args.no_vsync)?;
        self.state.open = Some(Open { window, shown, screen: None });
        Ok(())
    }

    /// Asks for the next frame, or waits until there is something new to show.
    fn wait(&mut self, events: &ActiveEventLoop) {
        let is_moving = self.clock.is_playing
            || self.state.has_stats
            || self.args.frames.is_some()
            || !self.state.hands.keys.is_empty();
        let Some(open) = &self.state.open else { return };
        let now = Instant::now();
        let retry = self.state.retry.filter(|at| *at > now);
        if (is_moving || !self.state.is_shown) && !self.state.is_hidden && retry.is_none() {
            open.window.request_redraw();
        }
        events.set_control_flow(ControlFlow::WaitUntil(retry.unwrap_or(now + GLANCE)));
    }

    fn event(&mut self, event: WindowEvent, events: &ActiveEventLoop) -> anyhow::Result<()> {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => self.frame(events)?,
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => self.state.is_shown = false,
            WindowEvent::Occluded(is_hidden) => (self.state.is_hidden, self.state.is_shown) = (is_hidden, false),
            WindowEvent::Focused(false) => self.state.hands.keys.clear(),
            WindowEvent::KeyboardInput { event, .. } => {
                let PhysicalKey::Code(key) = event.physical_key else { return Ok(()) };
                if event.state == ElementState::Released {
                    self.state.hands.keys.remove(&key);
                } else if HELD.contains(&key) {
                    self.state.hands.keys.insert(key);
                } else if !event.repeat {
                    self.key(key, events);
                }
                self.state.is_shown = false;
            }
            WindowEvent::MouseInput { state, button, .. } => {
                self.state.hands.button = (state == ElementState::Pressed).then_some(button);
                self.state.hands.is_scrubbing = self.state.hands.button == Some(MouseButton::Left) && self.is_on_bar();
                self.scrub();
            }
            WindowEvent::CursorMoved { position, .. } => {
                let by = DVec2::new(position.x, position.y) - self.state.hands.pointer;
                self.state.hands.pointer += by;
                self.drag(by);
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let pixels = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => -48.0 * f64::from(lines),
                    MouseScrollDelta::PixelDelta(by) => -by.y,
                };
                self.rig.approach((pixels.clamp(-200.0, 200.0) * 0.0015).exp());
                self.state.is_shown = false;
            }
            _ => {}
        }
        Ok(())
    }

    fn pixels(&self) -> [u32; 2] {
        self.state.open.as_ref().map_or([1, 1], |open| open.window.inner_size().into())
    }

    /// Pixels of a point of the overlay.
    fn scale(&self) -> usize {
        self.state.open.as_ref().map_or(1.0, |open| open.window.scale_factor()).round().clamp(1.0, 8.0) as usize
    }

    fn has_bar(&self) -> bool {
        self.clock.length > 0.0 && (self.args.screenshot.is_none() || self.state.has_stats)
    }

    fn is_on_bar(&self) -> bool {
        self.has_bar() && self.state.hands.pointer.y >= f64::from(self.pixels()[1]) - bar_height(self.scale()) as f64
    }

    fn scrub(&mut self) {
        if self.state.hands.is_scrubbing {
            let [from, to] = track(self.pixels()[0] as usize, self.scale()).map(|x| x as f64);
            let share = ((self.state.hands.pointer.x - from) / (to - from).max(1.0)).clamp(0.0, 1.0);
            self.seek(share * self.clock.length);
        }
    }

    fn drag(&mut self, by: DVec2) {
        let is_shifted = self.is_pressed(ShiftLeft);
        match self.state.hands.button {
            _ if self.state.hands.is_scrubbing => self.scrub(),
            Some(MouseButton::Left) if !is_shifted => self.rig.drag(by),
            Some(_) => self.rig.pan(by, self.pixels()),
            None => return,
        }
        self.state.is_shown = false;
    }

    fn is_pressed(&self, key: KeyCode) -> bool {
        self.state.hands.keys.contains(&key)
    }

    fn seek(&mut self, time: f64) {
        self.clock.set(time, self.clock.is_playing, self.clock.speed);
        self.state.is_shown = false;
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
            Space => self.clock.set(now, !clock.is_playing, clock.speed),
            Minus => self.clock.set(now, clock.is_playing, faster(-1)),
            Equal => self.clock.set(now, clock.is_playing, faster(1)),
            Home => self.seek(0.0),
            KeyJ => self.seek(now - 1.0),
            KeyL => self.seek(now + 1.0),
            Comma => self.seek(now - frame),
            Period => self.seek(now + frame),
            BracketLeft => self.go((self.current + n - 1) % n),
            BracketRight | KeyV => self.go((self.current + 1) % n),
            KeyR => self.go(0),
            KeyO => self.state.output = OUTPUTS[(self.state.output as usize + 1) % OUTPUTS.len()],
            F1 => self.state.output = Output::Color,
            F2 => self.state.output = Output::Alpha,
            F3 => self.state.output = Output::Depth,
            F4 => self.state.output = Output::Flow,
            KeyG => self.rig.is_flying = !self.rig.is_flying,
            KeyM => self.state.is_muted = !self.state.is_muted,
            KeyI => (self.state.has_stats, self.state.frames) = (!self.state.has_stats, Frames::default()),
            KeyF => self.fill_the_display(),
            Escape => events.exit(),
            // Nine views have keys of their own.
            key => match (key as usize).checked_sub(Digit1 as usize) {
                Some(view) if view < 9 => self.go(view),
                _ => {}
            },
        }
    }

    fn fill_the_display(&self) {
        if let Some(Open { window, .. }) = &self.state.open {
            let full = window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
            window.set_fullscreen(full);
        }
    }

    fn push(&self) -> Push {
        let axis = |less: KeyCode, more: KeyCode| f64::from(self.is_pressed(more)) - f64::from(self.is_pressed(less));
        Push {
            shift: DVec3::new(axis(KeyA, KeyD), axis(KeyE, KeyQ), axis(KeyS, KeyW)),
            turn: DVec2::new(axis(ArrowLeft, ArrowRight), axis(ArrowUp, ArrowDown)),
            is_fast: self.is_pressed(ShiftLeft),
        }
    }

    /// What the sound has to know.
    pub fn heard(&self) -> Heard {
        let turn = Pose::looking(self.rig.forward(), self.rig.above());
        Heard { clock: self.clock, place: self.rig.center(), turn, is_muted: self.state.is_muted }
    }

    fn layer(&self, width: u32) -> Layer {
        match self.state.output {
            Output::Color => Layer::Color,
            Output::Alpha => Layer::Alpha,
            // What is looked at is in the middle of the colours, and a hundredth of the picture is a fast motion.
            Output::Depth => Layer::Depth { high: (2.0 / self.rig.reach) as f32 },
            Output::Flow => Layer::Flow { high: width as f32 / 100.0 },
        }
    }

    fn frame(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let now = Instant::now();
        let between = self.state.last.map(|last| (now - last).as_secs_f64());
        self.rig.advance(self.push(), between.unwrap_or_default().min(0.1));
        if let Some(sound) = &self.sound {
            sound.tell(self.heard());
        }
        let Some(mut open) = self.state.open.take() else { return Ok(()) };
        let is_shown = self.draw(&mut open, now, between.map(|seconds| 1e3 * seconds));
        let is_shown =
            is_shown.and_then(|is_shown| if is_shown { self.count(&open, events) } else { Ok(()) }.map(|()| is_shown));
        self.state.open = Some(open);
        self.state.is_shown = is_shown?;
        self.state.retry = (!self.state.is_shown).then(|| Instant::now() + RETRY);
        // The time of a window that stands still is no frame's.
        self.state.last = self.state.is_shown.then_some(now);
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
        let text = format!(
            "{:?}  x{}  {name}{}",
            self.state.output,
            self.clock.speed,
            if self.state.is_muted { "  muted" } else { "" }
        );
        let Clock { length, is_playing, .. } = self.clock;
        let bar = self.has_bar().then_some(Bar { seconds, length, is_playing, text: &text });
        let stats = self.state.has_stats.then_some(&self.state.frames);
        let scale = open.window.scale_factor().round().clamp(1.0, 8.0) as usize;
        screen.lay(&gpu, &draw(size.map(|side| side as usize), scale, bar.as_ref(), stats))?;
        let begun = Instant::now();
        let report = self.renderer.show(&view, self.layer(width), &screen, self.state.has_stats)?;
        self.state.frames.add(1e3 * begun.elapsed().as_secs_f64(), between, report);
        let is_shown = open.shown.present(&screen.pixels)?;
        open.screen = Some(screen);
        Ok(is_shown)
    }

    /// Counts a frame that was shown, and ends with the last one.
    fn count(&mut self, open: &Open, events: &ActiveEventLoop) -> anyhow::Result<()> {
        self.state.n_frames += 1;
        if self.args.frames != Some(self.state.n_frames) {
            return Ok(());
        }
        if let (Some(file), Some(screen)) = (&self.args.screenshot, &open.screen) {
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
