"""C to shared libraries, by the compiler of the `ziglang` package."""
