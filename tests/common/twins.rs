//! Which test compares which kernel with which twin. `repo::kernels` holds the table of kernels against it.

/// A test in which the kernels of a shader are compared with a twin.
pub struct Tested {
    /// The shader, below `shaders-glsl`.
    pub shader: &'static str,
    /// A function or type of `ivv::internals::twin`.
    pub twin: &'static str,
    /// The test.
    pub test: &'static str,
    /// The file of the test.
    pub file: &'static str,
}

/// Lists a file's tests as `"SHADER" by TWIN in TEST;`. A twin or a test that is not there does not compile.
macro_rules! tested {
    ($($shader:literal by $twin:ident in $test:ident;)*) => {
        /// The shaders that tests of this file compare with twins.
        pub const TESTED: &[crate::common::twins::Tested] = &[$({
            #[expect(unused_imports, reason = "the import is the check that there is one of that name")]
            use ivv::internals::twin::$twin as _;
            let _: fn() = $test;
            let (shader, twin, test, file) = ($shader, stringify!($twin), stringify!($test), file!());
            crate::common::twins::Tested { shader, twin, test, file }
        }),*];
    };
}
pub(crate) use tested;
