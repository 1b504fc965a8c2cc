"""cli_live_test.py PROGRAM: streams as a user meets them. They come from this machine, by HTTP."""

import glob
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2

import docs_test

PROGRAM = ""


class Stream:
    """A camera with an address, that shows the images and then does as it is told."""

    def __init__(self, images, pause_s=0.05, repeat=True):
        stream = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                try:
                    while stream.is_on:
                        for image in images:
                            bytes_ = cv2.imencode(".jpg", image)[1].tobytes()
                            self.wfile.write(b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"
                                             % len(bytes_) + bytes_ + b"\r\n")
                            time.sleep(pause_s)
                        if not repeat:
                            stream.is_on = False
                except OSError:
                    pass  # nobody looks any more

            def log_message(self, *_):
                pass

        self.is_on = True
        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self.server.server_port}/eye"
        self.folder = f"127.0.0.1_{self.server.server_port}_eye"

    def end(self):
        self.is_on = False
        self.server.shutdown()
        self.server.server_close()


class CliLiveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        room = os.path.join(cls.folder, "room")
        subprocess.run([PROGRAM, "simulate", "room", "--frames", "60", "--out", room], check=True,
                       stdout=subprocess.DEVNULL)
        cls.camera = os.path.join(room, "camera.yaml")
        cls.images = [cv2.imread(name) for name in sorted(glob.glob(os.path.join(room, "rgb", "*")))]

    def stream(self, *arguments, **options):
        stream = Stream(*arguments, **options)
        self.addCleanup(stream.end)
        return stream

    def run_program(self, *arguments):
        return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=300, cwd=self.folder)

    def test_a_stream_that_stays_away_ends_the_run_with_its_results_and_an_error(self):
        stream = self.stream(self.images, repeat=False)
        saved = os.path.join(self.folder, "room.map")
        result = self.run_program("run", stream.url, "--camera", self.camera, "--quiet", "--save-map", saved)
        self.assertEqual(result.returncode, 2, result)
        self.assertEqual(result.stderr.count("no more images"), 1, result.stderr)
        self.assertIn("given up", result.stderr)
        self.assertIn(f"{stream.url}: gave no image for 60 s", result.stderr)
        for name in ("trajectory.txt", "summary.json", "report.html"):
            self.assertTrue(os.path.exists(os.path.join(self.folder, "out", stream.folder, name)), name)
        self.assertEqual(self.run_program("map", "validate", saved).returncode, 0)

    def test_each_run_has_results_of_its_own(self):
        stream = self.stream(self.images)
        for folder in (stream.folder, stream.folder + "_2"):
            # The faults leave it a stream.
            result = self.run_program("run", stream.url, "--camera", self.camera, "--quiet", "--max-frames", "5", "--inject",
                                      "black=0.1")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn(f"results will be in out/{folder}\n", result.stderr)
            with open(os.path.join(self.folder, "out", folder, "summary.json")) as file:
                self.assertIn('"realtime"', file.read())

    def calibrate_until(self, views, *, missing, images):
        """Ctrl-C when so many views were told, and nothing is missing if that is asked for."""
        camera = os.path.join(self.folder, "calibrated.yaml")
        with subprocess.Popen([PROGRAM, "calibrate", self.stream(images, pause_s=0.3).url, "--board", "9x6", "--square",
                               "0.025", "--out", camera], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as process:
            for line in process.stdout:
                if line.startswith("view ") and int(line.split()[1].rstrip(";")) >= views and (
                        missing or line.endswith(": nothing\n")):
                    process.send_signal(signal.SIGINT)
                    break
            output, errors = process.communicate(timeout=300)
        return process.returncode, output, errors, camera

    def test_ctrl_c_ends_a_capture_and_calibrates(self):
        code, output, errors, camera = self.calibrate_until(12, missing=False, images=list(docs_test.board_images()))
        self.assertEqual(code, 0, errors)
        self.assertIn("camera    ", output)
        self.assertTrue(os.path.exists(camera))
        os.remove(camera)

    def test_ctrl_c_too_early_says_what_is_missing(self):
        code, _, errors, camera = self.calibrate_until(2, missing=True, images=list(docs_test.board_images())[:4])
        self.assertEqual(code, 2, errors)
        self.assertIn("and 8 are needed", errors)
        self.assertFalse(os.path.exists(camera))


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
