# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line of farms. After Blender's own options:

    blender -b FILE --addons volley --python-expr "import volley.farm.command as c; c.main()" -- render ...
    blender -b --addons volley --python-expr "import volley.farm.command as c; c.main()" -- merge ...

From Blender 4.2 on also ``blender -b FILE --command volley render ...``. ``--help`` tells the options.
Exit codes: 0 all is there; 1 something failed; 2 the command line, or with --strict a file that is missing;
143 stopped by SIGTERM, parts that were finished are there.
"""

import argparse
import os
import re
import shutil
import signal
import sys
import time

import bpy

from .. import jobs, native
from . import files, job, merge, parts

EXIT_FAILED, EXIT_REFUSED = 1, 2
_MEGA = 1 << 20
_LEAST_MEMORY = 256  # MiB of address space for the threads that Blender starts for a render


def main(arguments=None):
    """Run the command line and leave Blender with its exit code."""
    if arguments is None:
        arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    try:
        code = run(arguments)
    except SystemExit as error:  # of argparse
        code = error.code or 0
    except Exception as error:
        job.say(f"error: {type(error).__name__}: {error}")
        code = EXIT_FAILED
    sys.stdout.flush()
    sys.stderr.flush()
    _remove_temporary_folder()
    os._exit(code)  # Blender's own way out ends with 0 from some versions on, and has nothing left to write


def _remove_temporary_folder():
    """As Blender does when it ends by itself. Where it could not make one, it names the one it was given."""
    folder = os.path.normpath(bpy.app.tempdir)
    if os.path.basename(folder).startswith("blender_"):
        shutil.rmtree(folder, ignore_errors=True)


def run(arguments):
    """The exit code of a command line."""
    options = _parser().parse_args(arguments)
    if native.load_error():
        job.say(f"error: {native.load_error()}")
        return EXIT_FAILED
    return options.run(options)


def _parser():
    parser = argparse.ArgumentParser(prog="volley", description="Renders of farms")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    render = commands.add_parser("render", help="render frames of the open file, or parts of their samples")
    render.set_defaults(run=_render)
    render.add_argument("--frames", help="as 1,5-8 or 1-100:10; the file's frame if not given")
    render.add_argument("--output", help="of whole frames, as Blender's -o; the file's if not given")
    render.add_argument("--parts", metavar="FOLDER", help="write parts there, and no pictures")
    render.add_argument("--samples", metavar="A:B", help="the samples from A on, before B; all if not given")
    render.add_argument("--blocks", metavar="I[-J]/N", help="of N even blocks of the samples those from I to J, "
                        "counted from 0, each as a part of its own")
    render.add_argument("--again", action="store_true", help="render also parts that are there")
    render.add_argument("--strict", action="store_true", help="refuse to render where a file is missing")
    render.add_argument("--threads", type=int, help="all that Slurm or the system allow if not given")
    render.add_argument("--memory", type=int, metavar="MIB", help="most address space of the process")
    render.add_argument("--summary", metavar="FILE", help="append each frame's summary, JSON, one a line")
    joining = commands.add_parser("merge", help="put parts together")
    joining.set_defaults(run=_merge)
    joining.add_argument("folder", help="of the parts")
    joining.add_argument("--output", required=True, help="multilayer OpenEXR files, #### for the frame")
    joining.add_argument("--frames", help="those that have parts if not given")
    joining.add_argument("--summary", metavar="FILE", help="as for render")
    return parser


_FRAMES = re.compile(r"(-?\d+)(?:-(-?\d+))?(?::(0*[1-9]\d*))?")  # first, last, step
_SAMPLES = re.compile(r"(\d+):(\d+)")
_BLOCKS = re.compile(r"(\d+)(?:-(\d+))?/(0*[1-9]\d*)")


def numbers_of(text):
    """The frames that 1,5-8 or 1-100:10 stand for; some may be negative, as -8--5."""
    found = []
    for piece in text.split(","):
        first, last, step = _numbers(_FRAMES, piece, "frames")
        numbers = range(first, (first if last is None else last) + 1, step or 1)
        if not numbers:
            raise ValueError(f"'{piece}' has no frames")
        found += numbers
    return found


def _numbers(form, text, what):
    """The groups of a text as whole numbers, None where it has none; ValueError where it is of another form."""
    match = form.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"'{text}' tells no {what}")
    return [None if group is None else int(group) for group in match.groups()]


def blocks_of(options, sample_count):
    """(begin, end) of each part to render."""
    if options.samples:
        blocks = [tuple(_numbers(_SAMPLES, options.samples, "samples"))]
    elif options.blocks:
        first, last, count = _numbers(_BLOCKS, options.blocks, "blocks")
        ends = [index * sample_count // count for index in range(count + 1)]
        blocks = list(zip(ends, ends[1:]))[first:(first if last is None else last) + 1]
    else:
        blocks = [(0, sample_count)]
    if not blocks or any(not 0 <= begin < end <= sample_count for begin, end in blocks):
        raise ValueError(f"there are no such samples of {sample_count}")
    return blocks


# Rendering ---------------------------------------------------------------------------------------

def _render(options):
    scene = bpy.context.scene
    try:
        frames = numbers_of(options.frames) if options.frames else [scene.frame_current]
        blocks = blocks_of(options, scene.volley.samples)
        if (options.samples or options.blocks) and not options.parts:
            raise ValueError("--samples and --blocks need --parts")
        if options.parts and any(layer.samples for layer in scene.view_layers if layer.use):
            raise ValueError("a view layer has samples of its own: parts need one number for all")
    except ValueError as error:
        job.say(f"error: {error}")
        return EXIT_REFUSED
    missing = missing_files(frames)
    for message in missing:
        job.say(f"{'error' if options.strict else 'warning'}: {message}")
    if missing and options.strict:
        return EXIT_REFUSED
    refusal = _limit_memory(options.memory) if options.memory else ""
    if refusal:
        job.say(f"error: {refusal}")
        return EXIT_REFUSED
    _limit_threads(options, scene)
    _listen()
    scene.render.engine = 'VOLLEY'
    scene.render.use_persistent_data = True
    codes = [_render_frame(options, scene, frame, blocks) for frame in frames if not job.job().is_stopped]
    if job.job().is_stopped:
        return 128 + signal.SIGTERM
    return max(codes)


def missing_files(frames):
    """What renders of frames read and the disk does not have."""
    found = {f"{name.split()[0]} {path}: there is no such file": None for frame in frames
             for name, path in files.paths(frame).items() if not os.path.isfile(path)}
    return list(found)


def _limit_threads(options, scene):
    threads = options.threads or int(os.environ.get("SLURM_CPUS_PER_TASK", 0))
    if not threads and hasattr(os, "sched_getaffinity"):
        threads = len(os.sched_getaffinity(0))
    if threads:
        scene.render.threads_mode, scene.render.threads = 'FIXED', threads


def address_space():
    """What this process has of it, MiB, 0 where the system does not say."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE") // _MEGA
    except OSError:
        return 0


def _limit_memory(limit):
    """Limit the address space, MiB; what speaks against it, or ""."""
    import resource  # not on Windows
    used = address_space()
    if limit < used + _LEAST_MEMORY:
        return f"--memory {limit}: Blender has {used} MiB already and waits for ever without {_LEAST_MEMORY} more"
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (limit * _MEGA, hard))
    return ""


def _listen():
    def stop(_number, _frame):
        job.job().is_stopped = True
        jobs.stop("stopped by SIGTERM")
    signal.signal(signal.SIGTERM, stop)


def _render_frame(options, scene, frame, blocks):
    """Render a frame, say how it went; the exit code."""
    job.begin_frame()
    start = time.monotonic()
    outputs, is_done = [], False
    scene.frame_set(frame)
    try:
        outputs = _render_parts(options, scene, blocks) if options.parts else _render_whole(options, scene)
        is_done = not job.job().failures
    except (RuntimeError, OSError, parts.PartError) as error:
        # The engine's own failures come again as errors of Blender's operator.
        job.add_failure(str(error).strip().removeprefix("Error: Volley: "))
    state = job.job()
    failures = list(dict.fromkeys(state.failures))
    for message in failures:
        job.say(f"error: frame {frame}: {message}")
    if not is_done and not failures:
        failures = ["the render ended without a picture"]
    job.say_summary({"frame": frame, "file": bpy.data.filepath, "seconds": round(time.monotonic() - start, 3),
                     "status": "done" if is_done else "failed", "outputs": outputs, "errors": failures,
                     "warnings": state.warnings, **state.counts}, options.summary)
    return 0 if is_done else EXIT_FAILED


def _render_whole(options, scene):
    if options.output:
        scene.render.filepath = options.output
    path, *of_views = _picture_paths(scene)
    before = {each: _stamp(each) for each in (path, *of_views)}
    kept, scene.render.filepath = scene.render.filepath, path
    try:
        bpy.ops.render.render(write_still=True)
    finally:
        scene.render.filepath = kept
    for paths in filter(None, ([path], of_views)):
        if all(_stamp(each) not in (None, before[each]) for each in paths):
            return paths
    if not job.job().failures:
        raise OSError(f"{path} was not written")
    return [path]


def _picture_paths(scene):
    """The path of a frame's picture, and those of its views, which may have files of their own instead."""
    render = scene.render
    views = [view.name for view in render.views if view.use] if render.use_multiview else []
    return [bpy.path.abspath(render.frame_path(frame=scene.frame_current, view=name)) for name in ("", *views)]


def _stamp(path):
    try:
        status = os.stat(path)
        return status.st_mtime_ns, status.st_ino, status.st_size
    except OSError:
        return None


def _render_parts(options, scene, blocks):
    settings, state = scene.volley, job.job()
    state.parts_folder = os.path.abspath(options.parts)
    kept = settings.sample_offset, settings.sample_subset
    has_lines = scene.render.use_freestyle
    outputs = []
    if has_lines:
        job.add_warning("Parts have no lines of Freestyle, which whole frames have")
    scene.render.use_freestyle = False  # it would render a scene with parts of the same names
    try:
        for index, (begin, end) in enumerate(blocks):
            state.block = index, len(blocks)
            paths = None if options.again else _parts_there(state.parts_folder, scene, begin, end)
            if paths is None:
                state.part_paths = []
                settings.sample_offset, settings.sample_subset = begin, end - begin
                bpy.ops.render.render()
                paths = state.part_paths
                if state.failures or not paths:
                    break
            outputs += paths
    finally:
        settings.sample_offset, settings.sample_subset = kept
        scene.render.use_freestyle = has_lines
        state.parts_folder = ""
    return outputs


def _parts_there(folder, scene, begin, end):
    """Paths of a block's parts that are whole and of this file and version; None if one is not."""
    layers = [layer.name for layer in scene.view_layers if layer.use]
    views = [view.name for view in scene.render.views if view.use] if scene.render.use_multiview else [""]
    paths = [parts.path_of(folder, scene, layer, view, begin, end) for layer in layers for view in views]
    try:
        wanted = parts.version(), parts.digests(scene)
        found = [parts.Part(path) for path in paths if os.path.exists(path)]
        are_ours = all((part.identity["version"], part.identity["file"]) == wanted for part in found)
        for part in found if are_ours else ():
            part.channels()
    except parts.PartError:
        return None
    return paths if are_ours and len(found) == len(paths) else None


# Merging -----------------------------------------------------------------------------------------

def _merge(options):
    found = merge.frames_in(options.folder)
    try:
        frames = numbers_of(options.frames) if options.frames else sorted(found)
    except ValueError as error:
        job.say(f"error: {error}")
        return EXIT_REFUSED
    if not frames:
        job.say(f"error: {options.folder}: there are no parts")
        return EXIT_FAILED
    code = 0
    for frame in frames:
        output, start = merge.output_path(options.output, frame), time.monotonic()
        errors, warnings = [], []
        try:
            warnings = merge.merge_frame(found.get(frame, []), output)
        except (parts.PartError, native.TracerError, OSError) as error:
            errors, code = [str(error)], EXIT_FAILED
            job.say(f"error: frame {frame}: {error}")
        job.say_summary({"frame": frame, "parts": len(found.get(frame, [])), "errors": errors,
                         "seconds": round(time.monotonic() - start, 3), "warnings": warnings,
                         "status": "failed" if errors else "done",
                         "outputs": [] if errors else [output]}, options.summary)
    return code


# Registration ------------------------------------------------------------------------------------

_handles = []


def register():
    if hasattr(bpy.utils, "register_cli_command"):
        _handles.append(bpy.utils.register_cli_command("volley", run))


def unregister():
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())
