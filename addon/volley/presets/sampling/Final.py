import bpy
volley = bpy.context.scene.volley

volley.integrator = 'DISTRIBUTION'
volley.samples = 1024
volley.preview_samples = 64
volley.light_samples = 0
volley.extra_samples = 0.25
volley.use_adaptive_sampling = True
volley.noise_threshold = 0.01
volley.adaptive_min_samples = 0
volley.time_limit = 0.0
