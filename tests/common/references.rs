//! Which test compares which kernel with which reference. `repo::kernels` holds the table of kernels against it.

/// A test in which the kernels of a shader are compared with a reference.
pub struct Tested {
    /// The shader, below `shaders-glsl`.
    pub shader: &'static str,
    /// A function or type of `ivv::internals::reference`.
    pub reference: &'static str,
    pub test: &'static str,
    pub file: &'static str,
}

/// Lists a file's tests as `"SHADER" by REFERENCE in TEST;`. A reference or a test that is not there does not compile.
macro_rules! tested {
    ($($shader:literal by $reference:ident in $test:ident;)*) => {
        /// The shaders that tests of this file compare with references.
        pub const TESTED: &[crate::common::references::Tested] = &[$({
            #[expect(unused_imports, reason = "the import is the check that there is one of that name")]
            use ivv::internals::reference::$reference as _;
            let _: fn() = $test;
            let (shader, reference, test, file) = ($shader, stringify!($reference), stringify!($test), file!());
            crate::common::references::Tested { shader, reference, test, file }
        }),*];
    };
}
pub(crate) use tested;
