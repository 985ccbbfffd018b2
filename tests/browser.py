"""Opens pages in headless Chromium and runs a script in each.

    python3 browser.py CHROMIUM JOBS.json

JOBS.json is a list of objects: `url`, and as far as wanted `script` (the body of an async function, whose value is printed),
`screenshot` (a file), `loaded` (a file that is made once the page is loaded), `size` ([width, height]), `dark` and `scale`. Prints a JSON list with `value`, `seconds` until the page was
loaded, and `errors`: what the console, exceptions and failed requests said. Speaks the DevTools protocol over pipes, so that
no port is opened; needs nothing but Python.
"""

import base64
import json
import os
import subprocess
import sys
import tempfile
import time

PATIENCE_S = 60


class Browser:
    def __init__(self, program, profile):
        to_browser, ours_out = os.pipe()
        ours_in, from_browser = os.pipe()
        for end in (to_browser, from_browser):
            os.set_inheritable(end, True)
        flags = [
            "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars",
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-pipe",
            f"--user-data-dir={profile}", "about:blank",
        ]
        # The browser reads descriptor 3 and writes descriptor 4.
        words = " ".join(f"'{flag}'" for flag in flags)
        shell = f"exec 3<&{to_browser} 4>&{from_browser}; exec '{program}' {words}"
        self.process = subprocess.Popen(
            ["bash", "-c", shell], pass_fds=[to_browser, from_browser], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(to_browser)
        os.close(from_browser)
        self.out, self.into = os.fdopen(ours_out, "wb", 0), os.fdopen(ours_in, "rb", 0)
        self.buffer, self.number, self.events = b"", 0, []

    def message(self):
        while b"\0" not in self.buffer:
            part = os.read(self.into.fileno(), 1 << 20)
            if not part:
                raise SystemExit("the browser has gone away")
            self.buffer += part
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, session=None, **parameters):
        self.number += 1
        number, message = self.number, {"id": self.number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        self.out.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == number:
                if "error" in answer:
                    raise SystemExit(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def until(self, method, session):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            for event in self.events:
                if event.get("method") == method and event.get("sessionId") == session:
                    return
            self.events.append(self.message())
        raise SystemExit(f"no {method} within {PATIENCE_S} s")

    def close(self):
        try:
            self.call("Browser.close")
        finally:
            self.process.wait(timeout=PATIENCE_S)


def complaints(events, session):
    for event in events:
        if event.get("sessionId") != session:
            continue
        parameters = event.get("params", {})
        match event["method"]:
            case "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                yield f"{details['text']} {details.get('exception', {}).get('description', '')}"
            case "Runtime.consoleAPICalled" if parameters["type"] in ("error", "warning", "assert"):
                yield " ".join(str(it.get("value", it.get("description"))) for it in parameters["args"])
            case "Log.entryAdded" if parameters["entry"]["level"] in ("error", "warning"):
                # That a screenshot waits for the graphics driver is no fault of the page.
                if "GL Driver Message (OpenGL, Performance" not in parameters["entry"]["text"]:
                    yield f"{parameters['entry']['text']} {parameters['entry'].get('url', '')}"
            case "Network.loadingFailed" if not parameters.get("canceled"):
                yield f"not loaded: {parameters['errorText']}"


def run(browser, job):
    target = browser.call("Target.createTarget", url="about:blank")["targetId"]
    session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    for domain in ("Page", "Runtime", "Log", "Network"):
        browser.call(f"{domain}.enable", session)
    width, height = job.get("size", [1280, 900])
    browser.call(
        "Emulation.setDeviceMetricsOverride", session, width=width, height=height, deviceScaleFactor=job.get("scale", 1),
        mobile=False,
    )
    features = [{"name": "prefers-color-scheme", "value": "dark" if job.get("dark") else "light"}]
    browser.call("Emulation.setEmulatedMedia", session, features=features)
    start = time.monotonic()
    browser.call("Page.navigate", session, url=job["url"])
    browser.until("Page.loadEventFired", session)
    seconds, value = time.monotonic() - start, None
    if "loaded" in job:
        open(job["loaded"], "w").close()
    if "script" in job:
        expression = f"(async () => {{ {job['script']} }})()"
        answer = browser.call(
            "Runtime.evaluate", session, expression=expression, awaitPromise=True, returnByValue=True, userGesture=True
        )
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise SystemExit(f"{job['url']}: {details['text']} {details.get('exception', {}).get('description', '')}")
        value = answer["result"].get("value")
    if "screenshot" in job:
        image = browser.call("Page.captureScreenshot", session, format="png", captureBeyondViewport=False)
        with open(job["screenshot"], "wb") as file:
            file.write(base64.b64decode(image["data"]))
    errors = list(complaints(browser.events, session))
    browser.call("Target.closeTarget", targetId=target)
    browser.events.clear()
    return {"value": value, "seconds": seconds, "errors": errors}


def main():
    program, jobs = sys.argv[1], json.load(open(sys.argv[2], encoding="utf-8"))
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        try:
            print(json.dumps([run(browser, job) for job in jobs]))
        finally:
            browser.close()


main()
