//! The window: events, frames, and what is shown.

use crate::overlay::{bar_height, draw, track};
use crate::sound::{Heard, Sound};
use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::screen::say;
use crate::{Args, keys};
use anyhow::Context;
use glam::{DVec2, DVec3};
use ivv::internals::profile::FrameTimes;
use ivv::internals::scene::{Navigator, Playhead, Push, View};
use ivv::internals::sound::pose::HeadPose;
use ivv::internals::stage::{Layer, Renderer, Screen};
use ivv::internals::vk::Swapchain;
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
/// A window without a given size fits in this, pixels.
const USUAL: [u32; 2] = [1280, 720];

#[derive(Clone, Copy, Debug, Default, PartialEq, clap::ValueEnum)]
pub enum Output {
    #[default]
    Color,
    Alpha,
    Depth,
    Flow,
}

pub const OUTPUTS: [Output; 4] = [Output::Color, Output::Alpha, Output::Depth, Output::Flow];

struct Open {
    window: Arc<Window>,
    shown: Swapchain,
    screen: Option<Screen>,
}

pub struct Player<'a> {
    pub args: &'a Args,
    pub stop: &'a Stop,
    pub renderer: Renderer,
    pub navigator: Navigator,
    pub views: Vec<View>,
    /// Index of the view that was gone to last.
    pub current: usize,
    pub clip: Playhead,
    /// A frame of the clip, in normalised time.
    pub flow_dt: f64,
    pub sound: Option<Sound>,
    pub state: State,
}

#[derive(Default)]
pub struct State {
    pub output: Output,
    pub has_stats: bool,
    pub is_muted: bool,
    pub lately: FrameTimes,
    open: Option<Open>,
    /// Of the last picture, pixels, and pixels of a point of its overlay.
    size: [u32; 2],
    scale: usize,
    /// Frames that the window took.
    n_frames: u64,
    last: Option<Instant>,
    keys: HashSet<KeyCode>,
    button: Option<MouseButton>,
    pointer: DVec2,
    is_scrubbing: bool,
    /// True if what is shown is up to date.
    is_shown: bool,
    /// When the window, which took no picture, is given one again.
    retry: Option<Instant>,
    is_hidden: bool,
    /// The outcome, once it ends.
    end: Option<anyhow::Result<()>>,
}

impl ApplicationHandler for Player<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        self.open(events).unwrap_or_else(|fault| self.end(Err(fault)));
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if self.state.end.is_none() {
            self.event(event).unwrap_or_else(|fault| self.end(Err(fault)));
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if self.stop.is_asked() || self.state.end.is_some() {
            events.exit();
        }
        self.wait(events);
    }
}

impl Player<'_> {
    /// Plays until the window is closed, the device fails, or an interruption.
    pub fn run(mut self, events: EventLoop<()>) -> anyhow::Result<()> {
        (self.state.output, self.state.has_stats) = (self.args.output, self.args.stats);
        let ran = events.run_app(&mut self).context("the window's events ended");
        // The loop tells the display's complaints at its end, also such that come of a fault of the device: that fault goes before.
        match self.state.end {
            Some(Err(fault)) => Err(fault),
            _ if self.stop.is_asked() => Err(Interrupted("the window is closed").into()),
            _ => ran,
        }
    }

    /// Ends with `done`, if nothing has ended it yet.
    pub fn end(&mut self, done: anyhow::Result<()>) {
        self.state.end.get_or_insert(done);
    }

    fn open(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let (width, height) = self.args.size.unwrap_or_else(|| {
            let [w, h] =
                self.views.first().map_or(USUAL, |view| [view.intrinsics.width, view.intrinsics.height]).map(f64::from);
            let zoom = (f64::from(USUAL[0]) / w).min(f64::from(USUAL[1]) / h);
            [w, h].map(|side| ((side * zoom).round() as u32).max(1)).into()
        });
        let wanted = Window::default_attributes().with_title("ivv").with_inner_size(PhysicalSize::new(width, height));
        let window = Arc::new(events.create_window(wanted).context("no window can be opened")?);
        let shown = self.renderer.gpu().window(window.clone(), !self.args.no_vsync)?;
        self.state.open = Some(Open { window, shown, screen: None });
        Ok(())
    }

    /// Asks for the next frame, or waits until there is something new to show.
    fn wait(&self, events: &ActiveEventLoop) {
        let state = &self.state;
        let is_moving =
            self.clip.is_playing() || state.has_stats || self.args.frames.is_some() || !state.keys.is_empty();
        let Some(open) = &state.open else { return };
        let now = Instant::now();
        let retry = state.retry.filter(|at| *at > now);
        if (is_moving || !state.is_shown) && !state.is_hidden && retry.is_none() {
            open.window.request_redraw();
        }
        events.set_control_flow(ControlFlow::WaitUntil(retry.unwrap_or(now + GLANCE)));
    }

    fn event(&mut self, event: WindowEvent) -> anyhow::Result<()> {
        let state = &mut self.state;
        match event {
            WindowEvent::CloseRequested => self.end(Ok(())),
            WindowEvent::RedrawRequested => return self.frame(),
            WindowEvent::Occluded(is_hidden) => state.is_hidden = is_hidden,
            WindowEvent::Focused(false) => state.keys.clear(),
            WindowEvent::KeyboardInput { event, .. } => match (event.physical_key, event.state) {
                (PhysicalKey::Code(key), ElementState::Released) => drop(state.keys.remove(&key)),
                (PhysicalKey::Code(key), ElementState::Pressed) if state.keys.insert(key) => keys::press(self, key),
                _ => return Ok(()),
            },
            WindowEvent::MouseInput { state: now, button, .. } => {
                state.button = (now == ElementState::Pressed).then_some(button);
                self.state.is_scrubbing = self.state.button == Some(MouseButton::Left) && self.is_on_bar();
                self.scrub();
            }
            WindowEvent::CursorMoved { position, .. } => {
                let by = DVec2::new(position.x, position.y) - state.pointer;
                state.pointer += by;
                match state.button {
                    None => return Ok(()),
                    _ if state.is_scrubbing => self.scrub(),
                    Some(MouseButton::Left) if !state.keys.contains(&ShiftLeft) => self.navigator.drag(by),
                    Some(_) => self.navigator.pan(by, state.size),
                }
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let pixels = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => -48.0 * f64::from(lines),
                    MouseScrollDelta::PixelDelta(by) => -by.y,
                };
                self.navigator.approach((pixels.clamp(-200.0, 200.0) * 0.0015).exp());
            }
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => {}
            _ => return Ok(()),
        }
        self.state.is_shown = false;
        Ok(())
    }

    fn has_bar(&self) -> bool {
        self.clip.length() > 0.0 && (self.args.screenshot.is_none() || self.state.has_stats)
    }

    fn is_on_bar(&self) -> bool {
        let State { size: [_, height], scale, pointer, .. } = self.state;
        self.has_bar() && pointer.y >= f64::from(height) - bar_height(scale) as f64
    }

    /// Goes to the time that the pointer is at, where it drags the bar.
    fn scrub(&mut self) {
        let State { size: [width, _], scale, pointer, is_scrubbing, .. } = self.state;
        if is_scrubbing {
            let [from, to] = track(width as usize, scale).map(|x| x as f64);
            self.clip.seek(((pointer.x - from) / (to - from).max(1.0)).clamp(0.0, 1.0) * self.clip.length());
        }
    }

    /// Goes to the view of this index, if there is one.
    pub fn go(&mut self, view: usize) {
        if let Some(found) = self.views.get(view) {
            self.current = view;
            self.navigator.go(found);
        }
    }

    pub fn fill_the_display(&self) {
        if let Some(Open { window, .. }) = &self.state.open {
            window.set_fullscreen(window.fullscreen().is_none().then_some(Fullscreen::Borderless(None)));
        }
    }

    fn push(&self) -> Push {
        let is_pressed = |key: KeyCode| f64::from(self.state.keys.contains(&key));
        let axis = |less: KeyCode, more: KeyCode| is_pressed(more) - is_pressed(less);
        Push {
            shift: DVec3::new(axis(KeyA, KeyD), axis(KeyE, KeyQ), axis(KeyS, KeyW)),
            turn: DVec2::new(axis(ArrowLeft, ArrowRight), axis(ArrowUp, ArrowDown)),
            is_fast: self.state.keys.contains(&ShiftLeft),
        }
    }

    pub fn heard(&self) -> Heard {
        let q = HeadPose::looking(self.navigator.forward(), self.navigator.above());
        Heard {
            clip: self.clip,
            head: HeadPose { t: 0.0, p: self.navigator.center(), q },
            is_muted: self.state.is_muted,
        }
    }

    fn layer(&self, width: u32) -> Layer {
        match self.state.output {
            Output::Color => Layer::Color,
            Output::Alpha => Layer::Alpha,
            // What is looked at is in the middle of the colours, and a hundredth of the picture is a fast motion.
            Output::Depth => Layer::Depth { high: (2.0 / self.navigator.reach) as f32 },
            Output::Flow => Layer::Flow { high: width as f32 / 100.0 },
        }
    }

    fn frame(&mut self) -> anyhow::Result<()> {
        let now = Instant::now();
        let between = self.state.last.map(|last| (now - last).as_secs_f64());
        self.navigator.advance(self.push(), between.unwrap_or_default().min(0.1));
        if let Some(sound) = &self.sound {
            sound.tell(self.heard());
        }
        let Some(mut open) = self.state.open.take() else { return Ok(()) };
        let drawn = self.draw(&mut open, now, between.map(|seconds| 1e3 * seconds));
        self.state.open = Some(open);
        self.state.is_shown = drawn?;
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
        let scale = open.window.scale_factor().round().clamp(1.0, 8.0) as usize;
        (self.state.size, self.state.scale) = (size, scale);
        let (seconds, length, speed) = (self.clip.at(now), self.clip.length(), self.clip.speed());
        let time = if length > 0.0 { seconds / length } else { 0.0 };
        let view = View { time, time_offset: 0.0, flow_dt: self.flow_dt, ..self.navigator.view(size) };
        let clock = format!("{} {seconds:5.2} / {length:.2}", if self.clip.is_playing() { '>' } else { '=' });
        let name = self.views.get(self.current).map_or("", |view| &view.name);
        let muted = if self.state.is_muted { "  muted" } else { "" };
        let text = format!("{:?}  x{speed}  {name}{muted}", self.state.output);
        let bar = self.has_bar().then_some((time, [clock.as_str(), &text]));
        let stats = self.state.has_stats.then_some(&self.state.lately);
        screen.lay(&gpu, &draw(size.map(|side| side as usize), scale, bar, stats))?;
        let begun = Instant::now();
        let report = self.renderer.show(&view, self.layer(width), &screen, self.state.has_stats)?;
        self.state.lately.add(1e3 * begun.elapsed().as_secs_f64(), between, report);
        let is_shown = open.shown.present(&screen.pixels.slice().binding())?;
        if is_shown {
            self.count(&screen)?;
        }
        open.screen = Some(screen);
        Ok(is_shown)
    }

    fn count(&mut self, screen: &Screen) -> anyhow::Result<()> {
        self.state.n_frames += 1;
        if self.args.frames == Some(self.state.n_frames) {
            if let Some(file) = &self.args.screenshot {
                screen.read(self.renderer.gpu())?.write_png(file)?;
                say!("{}: written", file.display());
            }
            self.end(Ok(()));
        }
        Ok(())
    }
}
