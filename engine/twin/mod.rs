//! Float64 truth and exact twins of the integer kernels, on the CPU. No SIMD, no threads, no cleverness.
