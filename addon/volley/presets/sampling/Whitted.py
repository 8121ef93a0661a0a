import bpy
volley = bpy.context.scene.volley

volley.integrator = 'WHITTED'
volley.samples = 1
volley.preview_samples = 1
volley.light_samples = 0
volley.extra_samples = 0.25
volley.use_adaptive_sampling = False
volley.time_limit = 0.0
