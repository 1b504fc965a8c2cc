"""The live view in headless Chromium, and what a hostile client can do to it: nothing.

The part with a browser is skipped where there is no Chromium.
"""

import base64
import contextlib
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest

import browser

PROGRAM = ""
FRAMES = 90
MIB = 1 << 20


def run_program(*arguments):
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout


class Viewer:
    """A program with a viewer; `url` is what it prints."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found, line + self.process.stderr.read()
        self.url = found.group(0)
        self.clients = []
        self.port = int(re.search(r":(\d+)/", self.url).group(1))

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=60)
        for client in self.clients:
            client.close()

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)

    def ask(self, text):
        """The first line of the answer to a request, "" when it is hung up."""
        with self.connect() as client:
            try:
                client.sendall(text.encode())
                return client.recv(4096).decode(errors="replace").split("\r\n")[0]
            except ConnectionError:
                return ""

    def open_websocket(self, target="/live", headers=""):
        """A socket after the handshake, and the first line of its answer."""
        client = self.connect()
        key = base64.b64encode(os.urandom(16)).decode()
        client.sendall((f"GET {target} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n{headers}\r\n").encode())
        answer = b""
        while b"\r\n\r\n" not in answer:
            chunk = client.recv(1)
            if not chunk:
                break
            answer += chunk
        self.clients.append(client)
        return client, answer.decode(errors="replace").split("\r\n")[0]

    def memory_mb(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            return int(re.search(r"VmRSS:\s+(\d+)", status.read()).group(1)) / 1024


def masked(payload, opcode=2, announced=None):
    """A frame of a client, which may announce more than it holds."""
    length = len(payload) if announced is None else announced
    head = bytes([0x80 | opcode])
    head += bytes([0x80 | length]) if length < 126 else bytes([0x80 | 127]) + struct.pack(">Q", length)
    return head + b"\0\0\0\0" + payload


def is_hung_up(client, patience_s=15):
    """Whether the server ends the connection; what it sends before that is read away."""
    client.settimeout(patience_s)
    try:
        while client.recv(1 << 16):
            pass
        return True
    except ConnectionError:
        return True
    except socket.timeout:
        return False


class Sequence(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.sequence = os.path.join(cls.shared, "walk")
        run_program("simulate", "office_walk", "--frames", str(FRAMES), "--out", cls.sequence)

    def start(self, *arguments, name="run"):
        out = os.path.join(self.shared, name)
        return Viewer("run", self.sequence, "--detector", f"boxes:{self.sequence}/boxes.csv", "--out", out, "--quiet", "--viewer", "0",
                      *arguments)


class HostileTest(Sequence):
    """All of it against one run that is paused, so that it is still there; at the end it goes on and ends as always."""

    def test_whatever_comes_is_refused_or_bounded(self):
        with self.start(name="hostile") as viewer:
            good, line = viewer.open_websocket()
            self.assertIn("101", line)
            good.sendall(masked(b"pause"))
            host = f"Host: 127.0.0.1:{viewer.port}\r\n"
            self.assertIn("200", viewer.ask(f"GET / HTTP/1.1\r\n{host}\r\n"))
            before = viewer.memory_mb()

            with self.subTest("no file can be asked for"):
                for path in ("/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/viewer.js/../../x", "/nothing"):
                    self.assertIn("404", viewer.ask(f"GET {path} HTTP/1.1\r\n{host}\r\n"), path)
            with self.subTest("only reading"):
                self.assertIn("405", viewer.ask(f"POST / HTTP/1.1\r\n{host}Content-Length: 3\r\n\r\nabc"))
            with self.subTest("pages of others, by their name for us and by a WebSocket"):
                self.assertIn("403", viewer.ask("GET / HTTP/1.1\r\nHost: evil.example:80\r\n\r\n"))
                self.assertIn("403", viewer.ask("GET / HTTP/1.1\r\n\r\n"))
                self.assertIn("403", viewer.open_websocket(headers="Origin: http://evil.example\r\n")[1])
                self.assertIn("101", viewer.open_websocket(headers=f"Origin: http://127.0.0.1:{viewer.port}\r\n")[1])
            with self.subTest("garbage"):
                for seed in range(20):
                    with viewer.connect() as client:
                        client.sendall(bytes((seed * 37 + i * i) % 256 for i in range(2000)))
                        self.assertTrue(is_hung_up(client))
                client = viewer.open_websocket()[0]
                client.sendall(bytes(range(256)) * 10)
                self.assertTrue(is_hung_up(client))
            with self.subTest("endless headers, a body of 100 MB, a message of 100 MB"):
                with viewer.connect() as client:
                    with self.assertRaises(OSError):
                        client.sendall(b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 2_000_000)
                        if is_hung_up(client):
                            raise ConnectionError
                self.assertNotIn("200", viewer.ask(f"GET / HTTP/1.1\r\n{host}Content-Length: 100000000\r\n\r\n"))
                client = viewer.open_websocket()[0]
                client.sendall(masked(b"x" * 1000, announced=100 * MIB))
                self.assertTrue(is_hung_up(client))
            with self.subTest("commands that are none"):
                for command in (b"", b"seek", b"seek -1", b"seek 1e300", b"speed nan", b"pause\0", b"\xff\xfe", b"reset now", b"x" * 200):
                    good.sendall(masked(command))
            with self.subTest("a request that drips is not waited for"):
                with viewer.connect() as client:
                    client.sendall(b"GET / HT")
                    self.assertTrue(is_hung_up(client, patience_s=60))
            with self.subTest("200 connections"):
                clients = []
                for _ in range(200):
                    clients.append(viewer.connect())
                time.sleep(0.3)
                good.sendall(masked(b"pause"))  # who was there before goes on
                for client in clients:
                    client.close()
                time.sleep(0.3)
                self.assertIn("200", viewer.ask(f"GET / HTTP/1.1\r\n{host}\r\n"))
            with self.subTest("more browsers than there is room for"):
                answers = [viewer.open_websocket() for _ in range(20)]
                self.assertIn("503", answers[-1][1])
                for client, _ in answers:
                    client.close()

            self.assertLess(viewer.memory_mb() - before, 60)
            self.assertIsNone(viewer.process.poll())
            viewer.open_websocket()[0].sendall(masked(b"resume"))
            self.assertEqual(viewer.process.wait(timeout=120), 0)

    def test_a_pause_ends_when_nobody_is_left_to_end_it(self):
        with self.start(name="left") as viewer:
            client, _ = viewer.open_websocket()
            client.sendall(masked(b"pause"))
            time.sleep(1)
            client.close()
            self.assertEqual(viewer.process.wait(timeout=60), 0)

    def test_another_address_needs_the_token(self):
        with self.start("--viewer-address", "0.0.0.0", name="token") as viewer:
            token = re.search(r"token=(\w{32})$", viewer.url).group(1)
            self.assertIn("403", viewer.open_websocket()[1])
            self.assertIn("403", viewer.open_websocket("/live?token=" + "0" * 32)[1])
            self.assertIn("403", viewer.open_websocket("/live?token=" + token[:-1])[1])
            client, line = viewer.open_websocket("/live?token=" + token)
            self.assertIn("101", line)
            client.sendall(masked(b"resume"))

    def test_a_port_that_is_taken_and_an_address_that_is_none(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = str(taken.getsockname()[1])
            result = subprocess.run([PROGRAM, "run", self.sequence, "--viewer", port, "--out", os.path.join(self.shared, "taken")],
                                    capture_output=True, text=True)
        self.assertEqual(result.returncode, 2)
        self.assertIn(port, result.stderr)
        result = subprocess.run([PROGRAM, "run", self.sequence, "--viewer", "0", "--viewer-address", "here", "--out",
                                 os.path.join(self.shared, "taken")], capture_output=True, text=True)
        self.assertEqual(result.returncode, 2)
        self.assertIn("'here' is no IP address", result.stderr)

    def test_the_port_may_be_left_out_before_the_source(self):
        result = subprocess.run([PROGRAM, "run", "--viewer", "/no/sequence", "--out", os.path.join(self.shared, "order")],
                                capture_output=True, text=True)
        self.assertEqual(result.returncode, 2)
        self.assertIn("/no/sequence", result.stderr)
        self.assertNotIn("--viewer", result.stderr)

    def test_a_browser_that_stands_still_costs_nothing(self):
        with self.start("--mode", "realtime", name="still") as viewer:
            self.assertIn("101", viewer.open_websocket()[1])
            still, _ = viewer.open_websocket()  # nobody reads from it
            self.assertEqual(viewer.process.wait(timeout=60), 0)
            still.close()


class RecordingTest(Sequence):
    def test_what_is_no_recording_is_named(self):
        folder = os.path.join(self.shared, "broken")
        os.makedirs(folder)
        file = os.path.join(folder, "recording.view")
        for content, reason in ((None, "there is no recording"), (b"PNG", "is no recording"), (b"DSVIEW01", "has no frames"),
                                (b"DSVIEW01" + b"\xff" * 1000, "has no frames")):
            if content is not None:
                with open(file, "wb") as out:
                    out.write(content)
            result = subprocess.run([PROGRAM, "view", folder, "--port", "0"], capture_output=True, text=True, timeout=20)
            self.assertEqual(result.returncode, 2)
            self.assertIn(reason, result.stderr)
            self.assertIn("recording.view", result.stderr)


@unittest.skipIf(browser.find_chromium() is None, "no chromium; it is in scripts/packages_test.txt")
class PageTest(Sequence):
    # Colours on a canvas; of the map, those beside the ground.
    COLOURS = """(() => {
      const from = document.getElementById("%s"), to = document.createElement("canvas");
      to.width = 200; to.height = 150;
      const context = to.getContext("2d");
      context.drawImage(from, 0, 0, 200, 150);
      return new Set(new Uint32Array(context.getImageData(0, 0, 200, 150).data.buffer)).size;
    })()"""
    FRAME = "(page.facts ? page.facts.frame : -1)"

    def look(self, page, name):
        if "VIEWER_SCREENSHOTS" in os.environ:
            page.screenshot(os.path.join(os.environ["VIEWER_SCREENSHOTS"], name + ".png"))

    def check_page(self, page):
        page.wait_for("page.facts && page.facts.landmarks > 100 && page.video.shown > 0")
        # Beside a run the map is drawn when its turn comes.
        page.wait_for(f"{self.COLOURS % 'map-canvas'} > 50")
        page.wait_for(f"{self.COLOURS % 'video-canvas'} > 500")
        self.assertGreater(page.evaluate("page.map.points.places.size"), 100)
        self.assertLessEqual(page.evaluate("document.documentElement.scrollWidth"), page.evaluate("innerWidth"))
        self.assertEqual(page.problems, [])

    def test_a_run_is_watched_paused_stepped_saved_and_reset(self):
        with contextlib.ExitStack() as stack:
            viewer = stack.enter_context(self.start(name="live"))
            holder, _ = viewer.open_websocket()
            holder.sendall(masked(b"pause"))  # a browser may take longer to start than the run lasts
            page = stack.enter_context(browser.Page(viewer.url))
            page.wait_for("page.live.readyState === 1 && page.paused")
            holder.close()
            while not page.evaluate("page.facts && page.facts.keyframes >= 3 && document.body.dataset.state === 'tracking'"):
                frame = page.evaluate(self.FRAME)
                page.evaluate("document.querySelector('[data-command=step]').click()")
                page.wait_for(f"{self.FRAME} > {frame}")
            self.assertTrue(page.evaluate("page.paused"))
            self.check_page(page)
            self.look(page, "live")
            self.assertGreater(page.evaluate("page.facts.boxes.filter((b) => b.moves).length"), 0)

            with self.subTest("a step is one frame"):
                time.sleep(0.5)
                frame = page.evaluate(self.FRAME)
                page.press("n")
                page.wait_for(f"{self.FRAME} > {frame}")
                time.sleep(0.3)
                self.assertEqual(page.evaluate(self.FRAME), frame + 1)
            with self.subTest("a late browser, as narrow as a phone, has everything"):
                with browser.Page(viewer.url, width=390, height=844) as late:
                    self.check_page(late)
                    self.look(late, "phone")
                    self.assertEqual(late.evaluate("page.map.points.places.size"), page.evaluate("page.map.points.places.size"))
                    self.assertEqual(late.evaluate("page.map.path.length"), page.evaluate("page.map.path.length"))
                    self.assertGreater(late.evaluate("page.events"), 0)
            with self.subTest("a connection that breaks is made again"):
                page.evaluate("page.live.close()")
                page.wait_for("page.live.readyState === 1 && document.getElementById('link').className === ''")
            with self.subTest("the map is saved"):
                page.press("s")
                page.wait_for("document.querySelector('#events').textContent.includes('The map is saved')")
                self.assertTrue(os.path.getsize(os.path.join(self.shared, "live", "viewer.map")) > 1000)
            with self.subTest("keys move the view"):
                page.press("t")
                self.assertEqual(page.evaluate("document.querySelector('[data-view=follow]').getAttribute('aria-pressed')"), "false")
                self.assertGreater(page.evaluate("page.map.eye.position.y - page.map.control.target.y"), 1)
                self.look(page, "top")
                page.press("f")
                self.assertTrue(page.evaluate("page.map.follows"))
            with self.subTest("a machine that draws slowly draws fewer points while the view moves"):
                drawn = page.evaluate("(() => { const p = page.map.points; for (let i = 0; i < 200; ++i) p.adapt(1); return [p.budget, p.choose(false)]; })()")
                self.assertEqual(drawn, [10000, True])  # fewer than that are always all drawn
                page.evaluate("page.map.points.budget = 50")
                self.assertFalse(page.evaluate("page.map.points.choose(false)"))
                self.assertEqual(page.evaluate("page.map.points.object.geometry.drawRange.count"), 50)
                self.assertTrue(page.evaluate("page.map.points.choose(true)"))
                page.evaluate("page.map.points.budget = 1e7")
            with self.subTest("a reset forgets the map"):
                page.evaluate("window.confirm = () => true")
                page.press("r")
                page.wait_for("page.map.points.places.size === 0 && page.map.path.length === 0")
            page.evaluate("send('resume')")
            page.wait_for("document.querySelector('#events').textContent.includes('The run has ended')")
            self.assertEqual(viewer.process.wait(timeout=60), 0)
            page.wait_for("document.getElementById('link').className === 'off'")

    def test_a_recording_plays_and_scrubs(self):
        out = os.path.join(self.shared, "recorded")
        run_program("run", self.sequence, "--detector", f"boxes:{self.sequence}/boxes.csv", "--out", out, "--quiet", "--record")
        with Viewer("view", out, "--port", "0") as viewer, browser.Page(viewer.url) as page:
            page.wait_for(f"{self.FRAME} >= 5")
            page.press(" ")
            page.wait_for("page.paused")

            def scrub_to(frame):
                page.evaluate(f"(() => {{ const p = document.getElementById('position'); p.value = {frame};"
                              " p.dispatchEvent(new Event('input')); p.dispatchEvent(new Event('change')); })()")
                page.wait_for(f"{self.FRAME} === {frame}")
                page.wait_for("page.video.shown === page.video.newest")
                return page.evaluate("[...page.map.points.places.keys()].sort((a, b) => a - b).join()"), page.evaluate(
                    "page.map.path.length"), page.evaluate("page.events")

            middle = scrub_to(50)
            last = scrub_to(FRAMES - 1)
            self.check_page(page)
            self.look(page, "replay")
            self.assertGreater(last[1], middle[1])
            self.assertEqual(scrub_to(50), middle, "the same forth and back")
            first = scrub_to(0)
            self.assertEqual(first[1], 0)
            page.press("ArrowRight")
            page.wait_for(f"{self.FRAME} === 1")
            page.evaluate("send('speed 4')")
            page.press(" ")
            page.wait_for(f"{self.FRAME} >= 60")
            self.assertEqual(page.problems, [])


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
