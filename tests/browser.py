"""A page in headless Chromium, by the browser's own protocol over a pipe: what it logs, what is in it, how it looks."""

import base64
import json
import os
import shutil
import subprocess
import tempfile


def find_chromium():
    """The program, or None where there is none."""
    return shutil.which("chromium")


class Page:
    """A page of a file, or of an address of this machine. What it logs and throws is in `problems`."""

    def __init__(self, address, width=1280, height=900, dark=False):
        self.own = address if address.startswith("http:") else "file:"
        self.profile = tempfile.mkdtemp()
        from_us, to_browser = os.pipe()
        from_browser, to_us = os.pipe()

        def take_pipes():  # the protocol's descriptors are 3 and 4
            low, high = os.dup(from_us), os.dup(to_us)
            os.dup2(low, 3)
            os.dup2(high, 4)

        self.browser = subprocess.Popen(
            [find_chromium(), "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run",
             "--disable-background-networking", "--hide-scrollbars", "--user-data-dir=" + self.profile,
             "--remote-debugging-pipe", "about:blank"],
            preexec_fn=take_pipes, pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(from_us)
        os.close(to_us)
        self.to_browser, self.from_browser = os.fdopen(to_browser, "wb", 0), os.fdopen(from_browser, "rb")
        self.session, self.number, self.buffer, self.problems, self.events = None, 0, b"", [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.call(domain + ".enable")
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        self.resize(width, height)
        self.call("Page.navigate", url=address if address.startswith("http:") else "file://" + os.path.abspath(address))
        self.wait_for("document.readyState === 'complete'")

    def close(self):
        self.to_browser.close()
        self.browser.terminate()
        self.browser.wait()
        self.from_browser.close()
        shutil.rmtree(self.profile, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()

    def read(self):
        """The next message of the browser."""
        while b"\0" not in self.buffer:
            chunk = self.from_browser.read1(1 << 20)
            if not chunk:
                raise RuntimeError("the browser ended")
            self.buffer += chunk
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.to_browser.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self.read()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.note(answer)

    def note(self, event):
        method, parameters = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.problems.append(parameters["exceptionDetails"].get("exception", {}).get("description", "exception"))
        elif method == "Runtime.consoleAPICalled":
            self.problems.append(" ".join(str(a.get("value")) for a in parameters["args"]))
        elif method == "Log.entryAdded":
            self.problems.append(parameters["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            address = parameters["request"]["url"]
            own = self.own.split("?")[0]
            if not address.startswith((own, "blob:" + own, "data:", "about:")):
                self.problems.append("asks the network for " + address)

    def evaluate(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def wait_for(self, expression):
        """Until the expression holds; a page that is still loading does not know its names."""
        self.evaluate("new Promise(done => { const holds = () => { try { return %s; } catch { return false; } }; const look = "
                      "() => { if (holds()) done(true); else setTimeout(look, 20); }; look(); })" % expression)

    def resize(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.settle()

    def settle(self):
        """Until everything is drawn."""
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")

    def press(self, key):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key)
        self.settle()

    def screenshot(self, file):
        height = self.evaluate("document.documentElement.scrollHeight")
        width = self.evaluate("innerWidth")
        self.settle()
        picture = self.call("Page.captureScreenshot", captureBeyondViewport=True,
                            clip={"x": 0, "y": 0, "width": width, "height": height, "scale": 1})
        with open(file, "wb") as out:
            out.write(base64.b64decode(picture["data"]))

    def pdf_pages(self):
        pdf = base64.b64decode(self.call("Page.printToPDF", printBackground=True)["data"])
        return pdf.count(b"/Type /Page\n") or pdf.count(b"/Type /Page")
