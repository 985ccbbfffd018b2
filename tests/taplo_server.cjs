// taplo's language server as the editor extension "Even Better TOML" runs it, on standard input and output.
// The package `@taplo/lsp` is looked up on NODE_PATH.
const fs = require("node:fs");
const path = require("node:path");
const { TaploLsp } = require("@taplo/lsp");

const environment = {
  cwd: () => process.cwd(),
  envVar: (name) => process.env[name],
  envVars: () => Object.entries(process.env),
  fetch: { fetch, Headers, Request, Response },
  findConfigFile: () => undefined,
  glob: () => [],
  isAbsolute: path.isAbsolute,
  isWindows: () => false,
  now: () => new Date(),
  readFile: (file) => fs.promises.readFile(file),
  stdErrAtty: () => false,
  stderr: process.stderr,
  stdin: process.stdin,
  stdout: process.stderr,
  urlToFilePath: (url) => decodeURIComponent(url).slice("file://".length),
  writeFile: (file, content) => fs.promises.writeFile(file, content),
};

function onMessage(message) {
  const text = JSON.stringify(message);
  process.stdout.write(`Content-Length: ${Buffer.byteLength(text)}\r\n\r\n${text}`);
}

process.on("unhandledRejection", (error) => {
  console.error(error);
  process.exit(1);
});

TaploLsp.initialize(environment, { onMessage }).then((server) => {
  let received = Buffer.alloc(0);
  process.stdin.on("data", (chunk) => {
    received = Buffer.concat([received, chunk]);
    for (;;) {
      const body = received.indexOf("\r\n\r\n") + 4;
      if (body < 4) return;
      const end = body + Number(/content-length: *(\d+)/i.exec(received.subarray(0, body))[1]);
      if (received.length < end) return;
      const message = JSON.parse(received.subarray(body, end));
      received = received.subarray(end);
      if (message.method === "exit") process.exit(0);
      server.send(message);
    }
  });
});
