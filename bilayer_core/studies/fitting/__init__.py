"""Fits: parameters of a scene such that its run agrees with measured data, by least squares, with intervals.

The data say what a run should have come to at which times (`data`), the parameters are keys of the scene with bounds
(`parameters`), a run is made for each set of values (`runs`). Derivatives are central differences over steps that
follow from the numerical noise of the runs (`noise`). What the data cannot tell apart is named instead of fitted
(`identify`), the rest has intervals (`intervals`). `fit` puts these together.
"""
