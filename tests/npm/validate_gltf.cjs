// Prints the Khronos validator's report on each file named on the command line, as a JSON array.
const fs = require("fs");
const path = require("path");
const validator = require("gltf-validator");

function validate(file) {
  const folder = path.dirname(file);
  return validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    maxIssues: 10000,
    externalResourceFunction: async (uri) =>
      new Uint8Array(fs.readFileSync(path.join(folder, decodeURIComponent(uri)))),
  });
}

Promise.all(process.argv.slice(2).map(validate)).then((reports) =>
  process.stdout.write(JSON.stringify(reports)),
);
