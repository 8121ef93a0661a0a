# SPDX-License-Identifier: Apache-2.0
"""One Blender that answers the requests of many tests, each from the startup file: to start one takes longer
than most tests."""

import json
import os
import select
import subprocess
import tempfile

from blender import Blender, BlenderError, command_line, user_scripts

_LEAVING_SECONDS = 10.0
_server = None


class SharedBlender(Blender):
    """A Blender whose ``run`` is answered by the one that is shared, unless it has options of its own."""

    def run(self, function, *arguments, timeout=120):
        if self.options:
            return super().run(function, *arguments, timeout=timeout)
        request, answer = self._request(function, arguments)
        process = self._ask(request, timeout)
        try:
            return self._answer(answer, process)
        except BlenderError:
            close()  # whose state nobody knows
            raise

    def _ask(self, request, timeout):
        """Let the shared Blender answer; its process."""
        global _server
        if _server is not None and _server.process.poll() is not None:
            close()
        if _server is None:
            _server = Server()
        try:
            self.output = _server.answer(request, self.folder, timeout)
        except subprocess.TimeoutExpired as error:
            close()
            raise BlenderError(f"Blender did not end within {timeout} s:\n{error.output}") from error
        return _server.process


def close():
    """End the shared Blender, if there is one; the next request starts another."""
    global _server
    if _server is not None:
        _server.close()
        _server = None


class Server:
    """A Blender that answers one request after the other."""

    def __init__(self):
        self._log = tempfile.TemporaryFile()
        self._ready, ready = os.pipe()
        self.process = subprocess.Popen(command_line([], "serve", str(ready)), pass_fds=[ready],
                                        env=dict(os.environ, BLENDER_USER_SCRIPTS=user_scripts()),
                                        stdin=subprocess.PIPE, stdout=self._log, stderr=subprocess.STDOUT)
        os.close(ready)

    def answer(self, request, folder, timeout):
        """Wait for it to call what a request asks for, in a folder; what it wrote meanwhile."""
        log, begin = self._log.fileno(), os.fstat(self._log.fileno()).st_size
        environment = dict(os.environ, BLENDER_USER_SCRIPTS=user_scripts())
        line = json.dumps({"request": request, "folder": folder, "environment": environment})
        try:
            self.process.stdin.write(line.encode() + b"\n")
            self.process.stdin.flush()
            is_ready = select.select([self._ready], [], [], timeout)[0]
        except BrokenPipeError:
            is_ready = True
        if is_ready and not os.read(self._ready, 1):
            self.process.wait()
        output = os.pread(log, os.fstat(log).st_size - begin, begin).decode(errors="replace")
        if not is_ready:
            raise subprocess.TimeoutExpired(self.process.args, timeout, output)
        return output

    def close(self):
        self.process.stdin.close()  # at which it ends, and writes what coverage.sh counts
        try:
            self.process.wait(_LEAVING_SECONDS)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._log.close()
        os.close(self._ready)
