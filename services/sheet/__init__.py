"""The shape of the paper: a plane, a smooth developable surface or a creased mesh, each with the face of `PageShape`.

`evidence` is what a photo shows of the shape, `tracing` and `outline` measure it. `plane`, `developable` and `ridged`
fit a shape to it, each on its own. `curved_page` and `ridged_page` start and check the fits of bent sheets. Which
shape is taken is decided in `services.rectify.shape_choice`.
"""
