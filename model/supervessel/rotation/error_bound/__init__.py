"""A bound of what law and method are off by, carried along a flight: [EB], model/docs/error_bound.md."""
