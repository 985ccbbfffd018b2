"""Creates a container in Azurite: python3 - PORT NAME. The account and its key are the emulator's own, which its manual names."""

import base64
import hashlib
import hmac
import http.client
import sys
from email.utils import formatdate

port, name = sys.argv[1:3]
account = "devstoreaccount1"
key = "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw=="
headers = {"x-ms-date": formatdate(usegmt=True), "x-ms-version": "2021-08-06"}
# "Authorize with Shared Key": the verb, eleven empty headers, the headers of the service, the resource.
lines = ["PUT", *[""] * 11, *(f"{field}:{text}" for field, text in headers.items())]
text = "\n".join([*lines, f"/{account}/{account}/{name}", "restype:container"])
signed = base64.b64encode(hmac.new(base64.b64decode(key), text.encode(), hashlib.sha256).digest()).decode()
headers |= {"Authorization": f"SharedKey {account}:{signed}", "Content-Length": "0"}
connection = http.client.HTTPConnection("127.0.0.1", int(port))
connection.request("PUT", f"/{account}/{name}?restype=container", headers=headers)
answer = connection.getresponse()
if answer.status != 201:
    sys.exit(f"{answer.status}: {answer.read().decode()}")
