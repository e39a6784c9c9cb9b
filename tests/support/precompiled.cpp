// The precompiled headers of the tests belong to a target, and that wants a source.
