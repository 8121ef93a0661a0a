# SPDX-License-Identifier: GPL-3.0-or-later
"""The program that reads images for the library, for Pythons that have OpenImageIO.

It stands in for tracer_reader, which does the same in C++ and which packages do not have: Blender's own
OpenImageIO is found from Python alone. It is started with a socket to the library as descriptor 3 and makes
processes, each of which serves requests one by one until it is ended, by whatever: a damaged file costs a
process, never Blender. On Windows, where processes cannot be copied, it is started for each, with a pipe as
standard input and output. What is said is described in the library's image/process_launch.h (making
processes) and image/protocol.h (reading); both ends are of one version.
"""

import array
import ctypes
import errno
import mmap
import os
import select
import signal
import socket
import struct
import sys
import time

try:
    import resource
except ImportError:  # Windows
    resource = None

# image/process_launch.h
_LAUNCH_MAGIC, _LAUNCH_DESCRIPTOR = 0x5443524C, 3
_CREATE = 1
_LAUNCH_REQUEST = struct.Struct("=IIqQ")   # magic, kind, process, bytes to share
_LAUNCH_ANSWER = struct.Struct("=Iiqii")   # magic, error, process, exit signal, exit code

# image/protocol.h
_MAGIC, _SLOTS, _SLOT_BYTES, _TEXT_BYTES = 0x54524301, 2, 4 << 20, 256
_FILE, _TAKEN, _COLORS, _APPLY = 1, 2, 3, 4
_INFO, _ROWS, _DONE, _FAILED = 1, 2, 3, 4
_REQUEST = struct.Struct("=IIQQI4xQIIII")  # as struct trc_reader_request
_ANSWER = struct.Struct(f"=II5I2IIi{_TEXT_BYTES}s")

# trc_status of failures, and how texels are stored (model/texel_format.h).
_TOO_LARGE, _OUT_OF_MEMORY, _IMAGE, _FORMAT = 4, 5, 10, 11
_U8, _U16, _F16, _F32 = range(4)
_TEXEL_BYTES = (1, 2, 2, 4)

_IDLE_SECONDS = 120    # without a request for so long a process ends, and with no process left the program
_MAX_PROCESSES = 256
_THREAD_SECONDS = 5    # for a thread to end that has nothing to do
_STRIP_ROWS = 64       # as OpenImageIO reads files of which nothing else is known
_COLOR_STEPS = 16      # by which a transform that changes nothing is found out
_PR_SET_PDEATHSIG = 1
_UNASSOCIATED = "oiio:UnassociatedAlpha"


class Failure(Exception):
    """Something to tell the library: a status and why."""

    def __init__(self, status, reason):
        super().__init__(reason)
        self.status = status


class Gone(Exception):
    """The library has gone: there is nobody to answer."""


# Streams -------------------------------------------------------------------------------------------

def _receive(stream, size):
    """So many bytes, None at the end of the stream."""
    parts = b""
    while len(parts) < size:
        part = stream.recv(size - len(parts))
        if not part:
            return None
        parts += part
    return parts


def _await(stream):
    """Whether something comes within the time that a process may be idle."""
    return bool(select.select([stream], [], [], _IDLE_SECONDS)[0])


class Connection:
    """A process's stream to the library, and the block of memory that both share."""

    def __init__(self, stream, block):
        self.stream, self.block = stream, block

    def request(self):
        """The next request as a tuple of the fields of trc_reader_request."""
        received = _receive(self.stream, _REQUEST.size)
        if received is None:
            raise Gone
        request = _REQUEST.unpack(received)
        if request[0] != _MAGIC:
            raise Gone
        return request

    def reply(self, kind, info=(0, 0, 0, 0, 0), slot=0, row_count=0, is_identity=0, status=0, text=""):
        """Answer; info: width, height, channels, format, whether alpha is unassociated."""
        cut = text.encode("utf-8", "replace")[:_TEXT_BYTES - 1]
        try:
            self.stream.sendall(_ANSWER.pack(_MAGIC, kind, *info, slot, row_count, is_identity, status, cut))
        except OSError as error:
            raise Gone from error


# Memory --------------------------------------------------------------------------------------------

def _address_space():
    if not resource:
        return 0
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * resource.getpagesize()
    except OSError:
        return 0


class Memory:
    """Limits of address space besides what the process had at its start."""

    def __init__(self):
        self._own = _address_space()

    def limit(self, byte_count):
        """Have memory refused that goes beyond."""
        if not self._own:
            return
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        wanted = self._own + byte_count
        resource.setrlimit(resource.RLIMIT_AS, (wanted if hard < 0 else min(wanted, hard), hard))


# Files ---------------------------------------------------------------------------------------------

def _texel_of(oiio, channel_format):
    """How a channel of the file is stored."""
    return {oiio.UINT8: _U8, oiio.INT8: _U8, oiio.UINT16: _U16, oiio.INT16: _U16,
            oiio.HALF: _F16}.get(channel_format.basetype, _F32)


def _format_of(oiio, spec):
    """The widest of the file's channels decides."""
    widest = _U8
    for channel_format in spec.channelformats or [spec.format]:
        own = _texel_of(oiio, channel_format)
        # Whole numbers of 16 bits do not fit into half floats.
        if {own, widest} == {_U16, _F16}:
            own = _F32
        widest = max(widest, own)
    return widest


def _is_unassociated(spec, format_name):
    """Whether colours still have to be multiplied by alpha. Some readers do not say; Blender takes Targa,
    DDS and Photoshop files as not multiplied unless marked, and so does this."""
    if spec.get_int_attribute(_UNASSOCIATED, 0):
        return True
    if format_name == "targa":
        return spec.get_int_attribute("targa:alpha_type", -1) != 4
    return format_name in ("dds", "psd")


def _is_format_known(oiio, path):
    """Whether the format of files with such a name is known."""
    suffix = os.path.splitext(path)[1][1:].lower()
    known = oiio.get_string_attribute("extension_list")  # format:name,name;format:name
    return bool(suffix) and any(suffix in entry.partition(":")[2].split(",") for entry in known.split(";"))


def _open(oiio, path):
    """The open file, by what is in it, whatever its name is."""
    config = oiio.ImageSpec()
    config.attribute(_UNASSOCIATED, 1)  # alpha stays as in the file: it is multiplied later
    found = oiio.ImageInput.open(path, config)
    reason = "" if found else oiio.geterror()
    names = [] if found else oiio.get_string_attribute("input_format_list").split(",")
    for name in names:
        candidate = oiio.ImageInput.create(name)
        if candidate and candidate.open(path, config):
            return candidate
        oiio.geterror()
    if not found:
        raise Failure(_IMAGE if _is_format_known(oiio, path) else _FORMAT, reason)
    return found


class File:
    """An open image file."""

    def __init__(self, oiio, path):
        self._input = _open(oiio, path)
        self.spec = spec = self._input.spec()
        if spec.width <= 0 or spec.height <= 0 or spec.depth > 1 or spec.nchannels <= 0:
            raise Failure(_IMAGE, "it has no pixels in two dimensions")
        self.channels = min(spec.nchannels, 4)
        self.format = _format_of(oiio, spec)
        self._type = oiio.TypeDesc((oiio.UINT8, oiio.UINT16, oiio.HALF, oiio.FLOAT)[self.format])
        self.row_bytes = spec.width * self.channels * _TEXEL_BYTES[self.format]
        self.info = (spec.width, spec.height, self.channels, self.format,
                     int(_is_unassociated(spec, self._input.format_name())))

    def blocks(self, row_capacity):
        """Its rows from top to bottom, as arrays of some rows each."""
        spec = self.spec
        if spec.tile_width > 0:
            step = min(spec.tile_height, spec.height)
        else:
            strip = max(1, spec.get_int_attribute("tiff:RowsPerStrip", _STRIP_ROWS))
            step = row_capacity - row_capacity % strip if row_capacity > strip else row_capacity
        for row in range(0, spec.height, step):
            yield self._read(row, min(step, spec.height - row))

    def _read(self, row, count):
        spec, first = self.spec, self.spec.y + row
        if spec.tile_width > 0:
            rows = self._input.read_tiles(0, 0, spec.x, spec.x + spec.width, first, first + count, spec.z,
                                          spec.z + 1, 0, self.channels, self._type)
        else:
            rows = self._input.read_scanlines(0, 0, first, first + count, spec.z, 0, self.channels, self._type)
        if rows is None:
            raise Failure(_IMAGE, self._input.geterror())
        return memoryview(rows.tobytes())


class Rows:
    """The rows of a file on their way to the library, through both slots by turns."""

    def __init__(self, to, row_bytes):
        self._to, self._row_bytes = to, row_bytes
        self.capacity = _SLOT_BYTES // row_bytes
        self._sent = self._taken = 0

    def send(self, rows):
        """Send rows, in as many parts as it takes."""
        step = self.capacity * self._row_bytes
        for begin in range(0, len(rows), step):
            part = rows[begin:begin + step]
            if self._sent - self._taken >= _SLOTS:
                if self._to.request()[1] != _TAKEN:
                    raise Gone
                self._taken += 1
            slot = self._sent % _SLOTS
            self._to.block[slot * _SLOT_BYTES:slot * _SLOT_BYTES + len(part)] = part
            self._sent += 1
            self._to.reply(_ROWS, slot=slot, row_count=len(part) // self._row_bytes)


def _serve_file(to, oiio, memory, request):
    _, _, memory_bytes, memory_bytes_max, memory_per_byte, pixel_bytes_max, path_bytes, *_ = request
    path = os.fsdecode(to.block[:path_bytes - 1])
    memory.limit(memory_bytes)
    file = File(oiio, path)
    pixel_bytes = file.row_bytes * file.spec.height
    if pixel_bytes > pixel_bytes_max or file.row_bytes > _SLOT_BYTES:
        raise Failure(_TOO_LARGE, f"it claims {file.spec.width} x {file.spec.height} pixels, which is too "
                      "large for such a file")
    to.reply(_INFO, file.info)
    memory.limit(min(memory_bytes + memory_per_byte * pixel_bytes, memory_bytes_max))
    rows = Rows(to, file.row_bytes)
    for block in file.blocks(rows.capacity):
        rows.send(block)
    to.reply(_DONE)


# Colours -------------------------------------------------------------------------------------------

class Colors:
    """Conversion from a colour space to the role scene_linear of an OpenColorIO configuration."""

    def __init__(self, oiio):
        self._oiio = oiio
        self._config = self._space = None

    def _convert(self, rgba):
        """Colours (n, 4) float32, converted."""
        oiio, count = self._oiio, len(rgba)
        # Images of three channels: the fourth is alpha, by which nothing is to be divided.
        source = oiio.ImageBuf(oiio.ImageSpec(count, 1, 3, oiio.FLOAT))
        if not source.set_pixels(oiio.ROI(0, count, 0, 1, 0, 1, 0, 3), rgba[None, :, :3].copy()):
            raise Failure(_IMAGE, source.geterror())
        converted = oiio.ImageBufAlgo.colorconvert(source, self._space, "scene_linear", False)
        if converted.has_error:
            raise Failure(_IMAGE, converted.geterror())
        rgba[:, :3] = converted.get_pixels(oiio.FLOAT).reshape(count, 3)
        return rgba

    def serve_space(self, to, memory, request):
        """Take a configuration and a space."""
        import numpy as np
        config_bytes, space_bytes = request[6:8]
        config = os.fsdecode(to.block[:config_bytes - 1])
        memory.limit(request[2])
        if self._config not in (None, config):
            raise Gone  # OpenImageIO keeps the first: a new process takes the other
        self._config = os.environ["OCIO"] = config
        problem = self._oiio.ColorConfig(config).geterror()
        if problem:
            raise Failure(_IMAGE, problem)
        self._space = os.fsdecode(to.block[config_bytes:config_bytes + space_bytes - 1])
        # Along the three channels and grey.
        steps = np.linspace(0.0, 1.0, _COLOR_STEPS, dtype=np.float32)
        probe = np.zeros((4, _COLOR_STEPS, 4), np.float32)
        for axis in range(3):
            probe[axis, :, axis] = probe[3, :, axis] = steps
        probe = probe.reshape(-1, 4)
        changed = np.abs(self._convert(probe.copy()) - probe)[:, :3]
        to.reply(_DONE, is_identity=int(bool((changed <= 1e-6).all())))

    def serve_apply(self, to, request):
        """Convert the colours in a slot."""
        import numpy as np
        slot, count = request[8:10]
        rgba = np.frombuffer(to.block, np.float32, 4 * count, slot * _SLOT_BYTES).reshape(count, 4)
        self._convert(rgba)
        to.reply(_DONE)


# Processes -----------------------------------------------------------------------------------------

def _serve(to, oiio, has_asked=_await):
    memory, colors = Memory(), Colors(oiio)
    while has_asked(to.stream):
        request = to.request()
        try:
            if request[1] == _FILE:
                _serve_file(to, oiio, memory, request)
            elif request[1] == _COLORS:
                colors.serve_space(to, memory, request)
            elif request[1] == _APPLY:
                colors.serve_apply(to, request)
        except Failure as failure:
            to.reply(_FAILED, status=failure.status, text=str(failure))
        except MemoryError:
            to.reply(_FAILED, status=_OUT_OF_MEMORY, text="it takes too much memory")
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            to.reply(_FAILED, status=_IMAGE, text=str(error))


def _run_process(oiio, launcher, descriptors, shared_bytes, parent):
    """In the new process, which ends with the launcher, in whatever it is."""
    status = 1
    try:
        launcher.close()
        block = mmap.mmap(descriptors[1], shared_bytes)
        os.close(descriptors[1])
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() == parent:
            _serve(Connection(socket.socket(fileno=descriptors[0]), block), oiio)
            status = 0
    except Gone:
        status = 0
    finally:
        os._exit(status)


class Launcher:
    """Makes and ends processes as the library asks."""

    def __init__(self, oiio):
        self._oiio = oiio
        self._stream = socket.socket(fileno=_LAUNCH_DESCRIPTOR)
        self._processes = set()  # made and not yet ended by request

    def run(self):
        """Until the library has gone, or has asked nothing for long."""
        while True:
            if not _await(self._stream):
                if any(self._lives(process) for process in self._processes):
                    continue
                return
            received = self._receive_request()
            if received is None:
                return
            (_, kind, process, shared_bytes), descriptors = received
            if kind == _CREATE and len(descriptors) == 2:
                answer = self._create(descriptors, shared_bytes)
            else:
                answer = self._end(process)
            self._stream.sendall(_LAUNCH_ANSWER.pack(_LAUNCH_MAGIC, *answer))

    def _receive_request(self):
        """A request and the descriptors that came with it, None at the end of the stream."""
        received, control, _, _ = self._stream.recvmsg(_LAUNCH_REQUEST.size, socket.CMSG_SPACE(8))
        descriptors = array.array("i")
        for level, kind, content in control:
            if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
                descriptors.frombytes(content[:len(content) - len(content) % descriptors.itemsize])
        if received and len(received) < _LAUNCH_REQUEST.size:
            rest = _receive(self._stream, _LAUNCH_REQUEST.size - len(received))
            received = received + rest if rest else b""
        if not received:
            return None
        request = _LAUNCH_REQUEST.unpack(received)
        return (request, list(descriptors)) if request[0] == _LAUNCH_MAGIC else None

    def _create(self, descriptors, shared_bytes):
        try:
            parent = os.getpid()
            child = os.fork() if len(self._processes) < _MAX_PROCESSES else -1
            if child == 0:
                _run_process(self._oiio, self._stream, descriptors, shared_bytes, parent)
        except OSError as error:
            return error.errno, 0, 0, 0
        finally:
            for descriptor in descriptors:
                os.close(descriptor)
        if child < 0:
            return errno.EAGAIN, 0, 0, 0
        self._processes.add(child)
        return 0, child, 0, 0

    def _end(self, process):
        if process not in self._processes:
            return errno.ESRCH, 0, 0, 0
        self._processes.remove(process)
        os.kill(process, signal.SIGKILL)  # no more than a formality if it is dead already
        _, status = os.waitpid(process, 0)
        if os.WIFSIGNALED(status):
            return 0, 0, os.WTERMSIG(status), 0
        return 0, 0, 0, os.WEXITSTATUS(status)

    @staticmethod
    def _lives(process):
        return os.waitid(os.P_PID, process, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None


class Pipe:
    """Standard input and output as the stream to the library; what is printed goes nowhere from here on."""

    def __init__(self):
        self._descriptor = os.dup(0)  # Python has made it binary
        nowhere = os.open(os.devnull, os.O_RDWR)
        os.dup2(nowhere, 0)
        os.dup2(nowhere, 1)

    def recv(self, size):
        """Up to so many bytes, b"" at the end."""
        return os.read(self._descriptor, size)

    def sendall(self, content):
        """All bytes; OSError when nobody reads them."""
        while content:
            content = content[os.write(self._descriptor, content):]


def _count_threads():
    return len(os.listdir("/proc/self/task")) if os.path.isdir("/proc/self/task") else 0


def _do_without_threads(oiio):
    """Files are read side by side by several processes, which need no threads. OpenImageIO starts one all the same and
    ends it at once: a process that is copied while that thread holds the lock of its pool would wait for ever."""
    own, deadline = _count_threads(), time.monotonic() + _THREAD_SECONDS
    oiio.attribute("threads", 1)
    while _count_threads() > own and time.monotonic() < deadline:
        time.sleep(0.001)


def _load_openimageio():
    import OpenImageIO as oiio
    import numpy  # noqa: F401  (loaded once, not in each process)
    _do_without_threads(oiio)
    oiio.attribute("exr_threads", 1)
    oiio.get_string_attribute("input_format_list")  # finds what there is before processes are made
    return oiio


def _run_single(name, shared_bytes):
    """The one process that was started, which shares the block of that name. It ends with its pipe."""
    pipe = Pipe()
    oiio = _load_openimageio()
    block = mmap.mmap(-1, shared_bytes, tagname=name)
    pipe.sendall(_LAUNCH_ANSWER.pack(_LAUNCH_MAGIC, 0, os.getpid(), 0, 0))
    try:
        _serve(Connection(pipe, block), oiio, lambda stream: True)
    except Gone:
        pass
    return 0


def main():
    """Take leave of what the host has left open, load the library, make processes."""
    if sys.platform == "win32":
        return _run_single(sys.argv[-2], int(sys.argv[-1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.closerange(_LAUNCH_DESCRIPTOR + 1, resource.getrlimit(resource.RLIMIT_NOFILE)[0])
    os.set_inheritable(_LAUNCH_DESCRIPTOR, False)
    Launcher(_load_openimageio()).run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
