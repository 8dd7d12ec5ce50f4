// What a row of the table of kernels says, and how a family's row becomes its kernels.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    /// Gaussians of the scene.
    Gaussians,
    /// Active Gaussians: in the view's time and frustum.
    Active,
    /// The other Gaussians.
    Idle,
    /// Gaussians of blocks of which one may live at the view's time, and the static ones.
    Live,
    /// Pairs of a Gaussian and a tile.
    Intersections,
    /// Tiles of the picture.
    Tiles,
    /// Pixels of the picture.
    Pixels,
    /// Gaussians that touch a tile.
    Visible,
    /// Pairs of a pixel and an intersection that a blend evaluates: the block of pixels is hit and not finished.
    Evaluated,
    /// Those of them that add to their pixel.
    Added,
    /// One per dispatch.
    Dispatches,
    /// The count that the recording gives: see the comment at the row.
    Recorded,
}

/// Work, in the units of a device's peaks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Bytes to and from memory.
    pub bytes: f64,
    /// Bytes that a copy command reads and writes.
    pub copied: f64,
    /// Bytes that a fill command writes.
    pub filled: f64,
    /// Scattered rows of 64 bytes read.
    pub rows: f64,
    /// Float additions and multiplications.
    pub flops: f64,
    /// Powers of two.
    pub exp2: f64,
    /// Shuffles, one per lane.
    pub shuffles: f64,
    /// Atomic additions.
    pub atomics: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// The count that it grows with; without it, that of the pass.
    pub per: Option<Count>,
    pub cost: Cost,
}

pub struct Axis {
    /// Its parameter of the generated function that picks a kernel: a bool where there are two values, an index otherwise.
    pub name: &'static str,
    /// By value: its part of the kernel's name, and a preprocessor definition; either may be empty.
    pub values: &'static [(&'static str, (&'static str, &'static str))],
}

pub struct Family {
    /// The shader, below `shaders-glsl`.
    pub file: &'static str,
    /// The choices between its kernels, in the order of their names.
    pub axes: &'static [Axis],
    /// From a choice to the one whose kernel does the same, where it has none of its own.
    pub same: fn(&mut [usize]),
    /// Its truth on the CPU, `module::name` of the engine's references. Empty where it computes nothing.
    pub reference: fn(&Spec) -> &'static str,
    /// The count that its time grows with.
    pub count: Count,
    /// The least that it must do: bytes that must come from memory or go there once, whatever the caches; float additions and
    /// multiplications, without those of addresses. None of what is outside a frame and a step: density control and the probes.
    pub cost: Option<fn(&Spec) -> Vec<Term>>,
}

pub struct Spec {
    pub name: String,
    /// Its shader, below `shaders-glsl`.
    pub file: &'static str,
    /// Preprocessor definitions.
    pub defines: Vec<(&'static str, &'static str)>,
    /// The count that its time grows with.
    pub count: Count,
    pub family: &'static Family,
    pub choice: Vec<usize>,
}

impl Spec {
    /// The number of a definition; 0 without it.
    pub fn value(&self, name: &str) -> usize {
        let found = self.defines.iter().find(|(key, _)| *key == name);
        found.and_then(|(_, value)| value.trim_end_matches('u').parse().ok()).unwrap_or(0)
    }

    /// Its truth on the CPU, `module::name` of the engine's references. Empty where it computes nothing.
    pub fn reference(&self) -> &'static str {
        (self.family.reference)(self)
    }

    /// True if a definition is there, and not 0.
    pub fn is(&self, name: &str) -> bool {
        self.value(name) != 0
    }

    pub fn degree(&self) -> usize {
        self.value("SH_DEGREE").min(3)
    }

    pub fn either(&self, name: &str, yes: f64, no: f64) -> f64 {
        if self.is(name) { yes } else { no }
    }

    /// Bytes of what a Gaussian moves by.
    pub fn motion(&self) -> f64 {
        self.either("DYNAMIC", 16.0, 0.0)
    }

    /// Bytes of a Gaussian's bands of colour beyond degree 0.
    pub fn bands(&self) -> f64 {
        [48.0, 64.0, 96.0].iter().take(self.degree()).sum()
    }

    pub fn sh_flops(&self) -> f64 {
        let degree = self.degree();
        6.0 * ((degree + 1) * (degree + 1)) as f64 + [0.0, 15.0, 35.0, 80.0][degree]
    }

    /// Every lane takes part in a shuffle and has several pixels: shuffles per pixel of `n` numbers handed around.
    pub fn shuffles(&self, n: f64) -> f64 {
        n / self.value("PIXELS").max(1) as f64
    }
}

impl Cost {
    pub const fn of(bytes: f64, flops: f64) -> Cost {
        let none = 0.0;
        Cost { bytes, copied: none, filled: none, rows: none, flops, exp2: none, shuffles: none, atomics: none }
    }
}

pub fn own(bytes: f64, flops: f64) -> Term {
    Term { per: None, cost: Cost::of(bytes, flops) }
}

pub fn per(count: Count, bytes: f64, flops: f64) -> Term {
    Term { per: Some(count), cost: Cost::of(bytes, flops) }
}

pub fn dispatch(_: &Spec) -> Vec<Term> {
    vec![own(0.0, 0.0)]
}

/// Blending: per entry of the lists, and per pixel and entry, with the numbers that are handed around and the flops of what adds.
pub fn blending(spec: &Spec, listed: Cost, pixels: f64, handed: f64, flops: f64) -> Vec<Term> {
    let evaluated = Cost { exp2: 1.0, shuffles: spec.shuffles(handed), ..Cost::of(0.0, 14.0) };
    vec![
        Term { per: Some(Count::Intersections), cost: Cost { rows: 1.0, ..listed } },
        per(Count::Active, 64.0, 0.0),
        per(Count::Pixels, pixels, 0.0),
        Term { per: Some(Count::Evaluated), cost: evaluated },
        per(Count::Added, 0.0, flops),
    ]
}

pub const NONE: (&str, &str) = ("", "");

pub const fn switch(name: &'static str, values: &'static [(&'static str, (&'static str, &'static str)); 2]) -> Axis {
    Axis { name, values }
}

pub const ROW: Family =
    Family { file: "", axes: &[], same: |_| {}, reference: |_| "", count: Count::Dispatches, cost: Some(dispatch) };

impl Family {
    /// The start of its kernels' names, and the name of the generated function that picks one: the stem of its file.
    pub fn name(&self) -> &'static str {
        let (_, name) = self.file.rsplit_once('/').unwrap_or_default();
        name.trim_end_matches(".comp")
    }

    /// Every choice of its axes, the last one fastest, with that of the kernel that does it.
    pub fn choices(&self) -> Vec<[Vec<usize>; 2]> {
        let mut all = vec![Vec::new()];
        for axis in self.axes {
            let longer = |choice: &Vec<usize>| {
                let more = |value| choice.iter().copied().chain([value]).collect();
                (0..axis.values.len()).map(more).collect::<Vec<Vec<usize>>>()
            };
            all = all.iter().flat_map(longer).collect();
        }
        let with_kernel = |choice: Vec<usize>| {
            let mut own = choice.clone();
            (self.same)(&mut own);
            [choice, own]
        };
        all.into_iter().map(with_kernel).collect()
    }

    pub fn kernel_name(&self, choice: &[usize]) -> String {
        let parts = self.axes.iter().zip(choice).map(|(axis, value)| axis.values[*value].0);
        let parts = parts.filter(|part| !part.is_empty());
        std::iter::once(self.name()).chain(parts).collect::<Vec<&str>>().join("_")
    }

    pub fn kernels(&'static self) -> Vec<Spec> {
        let kernel = |choice: Vec<usize>| Spec {
            name: self.kernel_name(&choice),
            file: self.file,
            defines: {
                let values = self.axes.iter().zip(&choice).map(|(axis, value)| axis.values[*value].1);
                values.filter(|define| *define != NONE).collect()
            },
            count: self.count,
            family: self,
            choice,
        };
        let own = self.choices().into_iter().filter(|[choice, kernel]| choice == kernel);
        own.map(|[choice, _]| kernel(choice)).collect()
    }
}
