// Plays one .glb, .usda, .usdc or .usdz in three.js and writes where the skinned vertices are.
//   node play_three.mjs FILE OUT_FOLDER TIMES_JSON
// OUT_FOLDER receives NAME.f32 of each skinned mesh: its rest pose, then one pose a time, in the
// world of three.js (Y-up, meters). Prints a JSON list of {name, vertices, colors, warnings}.
import fs from "node:fs";
import path from "node:path";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { USDLoader } from "three/addons/loaders/USDLoader.js";

const [file, folder, times_json] = process.argv.slice(2);
const bytes = fs.readFileSync(file);
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);

async function load() {
  if (/\.gl(b|tf)$/.test(file)) {
    const { scene, animations } = await new GLTFLoader().parseAsync(buffer, "");
    return { scene, animations };
  }
  const scene = new USDLoader().parse(file.endsWith(".usda") ? bytes.toString() : buffer);
  return { scene, animations: scene.animations };
}

const { scene, animations } = await load();
const root = new THREE.Scene().add(scene);
const mixer = new THREE.AnimationMixer(scene);
for (const animation of animations) mixer.clipAction(animation).play();
const meshes = [];
root.traverse((object) => object.isSkinnedMesh && meshes.push(object));

const point = new THREE.Vector3();
function positions(mesh, place) {
  const { count } = mesh.geometry.attributes.position;
  const out = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) place(mesh, i).applyMatrix4(mesh.matrixWorld).toArray(out, 3 * i);
  return out;
}
const at_rest = (mesh, i) => point.fromBufferAttribute(mesh.geometry.attributes.position, i);
const posed = (mesh, i) => mesh.getVertexPosition(i, point);

root.updateMatrixWorld(true);
const poses = new Map(meshes.map((mesh) => [mesh, [positions(mesh, at_rest)]]));
for (const time_s of JSON.parse(times_json)) {
  // Just below the end, since a looping action starts again there.
  mixer.setTime(Math.min(time_s, Math.max(...animations.map((a) => a.duration)) * (1 - 1e-9)));
  root.updateMatrixWorld(true);
  for (const mesh of meshes) poses.get(mesh).push(positions(mesh, posed));
}
for (const [mesh, arrays] of poses) {
  fs.writeFileSync(path.join(folder, `${mesh.name}.f32`), Buffer.concat(arrays.map((a) => new Uint8Array(a.buffer))));
}
const described = meshes.map((mesh) => ({
  name: mesh.name,
  vertices: mesh.geometry.attributes.position.count,
  has_colors: Boolean(mesh.geometry.attributes.color && mesh.material.vertexColors),
}));
process.stdout.write(JSON.stringify(described));
