// A scene in space: glTF 2.0 in WebGL 2, base colors under a light from above and one from the camera.
"use strict";
{
  const { state, setState, get } = syntable;
  const by = (id) => document.getElementById(id);
  const canvas = by("canvas"), says = by("says"), choice = by("scene");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: true });

  // ---- Matrices of 4 × 4, column by column ---------------------------------------------------------------------------------
  const times = (a, b) => {
    const out = new Float32Array(16);
    for (let column = 0; column < 4; column++) {
      for (let row = 0; row < 4; row++) {
        for (let k = 0; k < 4; k++) out[column * 4 + row] += a[k * 4 + row] * b[column * 4 + k];
      }
    }
    return out;
  };
  const minus = (a, b) => a.map((value, axis) => value - b[axis]);
  const plus = (a, b, scale = 1) => a.map((value, axis) => value + scale * b[axis]);
  const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
  const unit = (a) => {
    const length = Math.hypot(...a) || 1;
    return a.map((value) => value / length);
  };
  const ofNode = (node) => {
    if (node.matrix) return new Float32Array(node.matrix);
    const [x, y, z, w] = node.rotation ?? [0, 0, 0, 1], [sx, sy, sz] = node.scale ?? [1, 1, 1], [tx, ty, tz] = node.translation ?? [0, 0, 0];
    return new Float32Array([
      sx * (1 - 2 * (y * y + z * z)), sx * 2 * (x * y + z * w), sx * 2 * (x * z - y * w), 0,
      sy * 2 * (x * y - z * w), sy * (1 - 2 * (x * x + z * z)), sy * 2 * (y * z + x * w), 0,
      sz * 2 * (x * z + y * w), sz * 2 * (y * z - x * w), sz * (1 - 2 * (x * x + y * y)), 0,
      tx, ty, tz, 1,
    ]);
  };
  const looking = (eye, target) => {
    const back = unit(minus(eye, target)), right = unit(cross([0, 1, 0], back)), up = cross(back, right);
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    return new Float32Array([
      right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, dot(right), dot(up), dot(back), 1,
    ]);
  };
  const perspective = (angle, aspect, near, far) => {
    const f = 1 / Math.tan(angle / 2);
    return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
  };

  // ---- Shaders -------------------------------------------------------------------------------------------------------------
  const VERTEX = `#version 300 es
    in vec3 position; in vec3 normal; in vec2 uv;
    uniform mat4 world, camera; uniform mat3 turn; uniform vec4 mapping; uniform float rotation;
    out vec3 n, p; out vec2 t;
    void main() {
      vec4 at = world * vec4(position, 1.0);
      p = at.xyz; n = turn * normal;
      vec2 scaled = uv * mapping.zw; float c = cos(rotation), s = sin(rotation);
      t = vec2(c * scaled.x + s * scaled.y, c * scaled.y - s * scaled.x) + mapping.xy;
      gl_Position = camera * at;
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 n, p; in vec2 t;
    uniform vec4 base; uniform vec3 emitted, eye; uniform float cutoff, opaque; uniform sampler2D image;
    out vec4 color;
    void main() {
      vec4 encoded = texture(image, t), texel = vec4(pow(encoded.rgb, vec3(2.2)), encoded.a) * base;
      if (texel.a < cutoff) discard;
      vec3 v = normalize(eye - p), m = normalize(n);
      if (dot(m, v) < 0.0) m = -m;
      float sky = 0.62 + 0.38 * m.y, key = max(dot(m, normalize(vec3(0.35, 0.85, 0.4))), 0.0), head = max(dot(m, v), 0.0);
      vec3 light = texel.rgb * (0.34 * sky + 0.42 * key + 0.26 * head) + emitted;
      float alpha = mix(texel.a, 1.0, opaque);
      color = vec4(pow(min(light, 1.0), vec3(1.0 / 2.2)) * alpha, alpha);
    }`;
  const compile = () => {
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    ["position", "normal", "uv"].forEach((name, index) => gl.bindAttribLocation(program, index, name));
    gl.linkProgram(program);
    return program;
  };

  // ---- glTF ----------------------------------------------------------------------------------------------------------------
  const parsed = (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)), view = new DataView(bytes.buffer);
    let json = null, binary = new Uint8Array();
    for (let at = 12; at + 8 <= bytes.length;) {
      const length = view.getUint32(at, true), type = view.getUint32(at + 4, true), chunk = bytes.subarray(at + 8, at + 8 + length);
      if (type === 0x4e4f534a) json = JSON.parse(new TextDecoder().decode(chunk));
      else if (type === 0x004e4942) binary = chunk;
      at += 8 + length;
    }
    return { json, binary };
  };
  const ARRAYS = { 5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
  const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

  const load = async (text, program) => {
    const { json, binary } = parsed(text);
    const accessor = (index) => {
      const { bufferView, byteOffset = 0, componentType, count, type } = json.accessors[index];
      const { byteOffset: start = 0, byteStride } = json.bufferViews[bufferView];
      const Type = ARRAYS[componentType], width = WIDTHS[type], stride = byteStride ?? width * Type.BYTES_PER_ELEMENT;
      const out = new Type(count * width), from = new DataView(binary.buffer, binary.byteOffset + start + byteOffset);
      const read = { 5120: "getInt8", 5121: "getUint8", 5122: "getInt16", 5123: "getUint16", 5125: "getUint32", 5126: "getFloat32" }[componentType];
      for (let i = 0; i < count; i++) {
        for (let j = 0; j < width; j++) out[i * width + j] = from[read](i * stride + j * Type.BYTES_PER_ELEMENT, true);
      }
      return out;
    };
    const texture = (pixels, sampler = {}) => {
      const it = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, it);
      if (pixels instanceof Uint8Array) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, sampler.wrapS ?? gl.REPEAT);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, sampler.wrapT ?? gl.REPEAT);
      return it;
    };
    const white = texture(new Uint8Array([255, 255, 255, 255]));
    const decoded = new Map();
    const baseTexture = (index) => {
      const { source, sampler } = json.textures[index];
      if (!decoded.has(index)) {
        const { bufferView, mimeType } = json.images[source], { byteOffset = 0, byteLength } = json.bufferViews[bufferView];
        const blob = new Blob([binary.subarray(byteOffset, byteOffset + byteLength)], { type: mimeType });
        decoded.set(index, createImageBitmap(blob, { premultiplyAlpha: "none", colorSpaceConversion: "none" })
          .then((pixels) => texture(pixels, json.samplers?.[sampler])));
      }
      return decoded.get(index);
    };
    const material = async (index) => {
      const it = json.materials?.[index] ?? {}, pbr = it.pbrMetallicRoughness ?? {}, more = it.extensions ?? {};
      const [r, g, b, a] = pbr.baseColorFactor ?? [1, 1, 1, 1];
      const passes = more.KHR_materials_transmission?.transmissionFactor ?? 0;
      const isBlended = it.alphaMode === "BLEND" || passes > 0.5;
      const { offset = [0, 0], scale = [1, 1], rotation = 0 } = pbr.baseColorTexture?.extensions?.KHR_texture_transform ?? {};
      const strength = more.KHR_materials_emissive_strength?.emissiveStrength ?? 1;
      const emitted = (it.emissiveFactor ?? [0, 0, 0]).map((value) => Math.min(1, value * strength));
      return {
        base: [r, g, b, passes > 0.5 ? 0.28 : it.alphaMode === "BLEND" ? a : 1],
        cutoff: it.alphaMode === "MASK" ? it.alphaCutoff ?? 0.5 : 0,
        map: pbr.baseColorTexture ? await baseTexture(pbr.baseColorTexture.index) : white,
        mapping: [...offset, ...scale], rotation, emitted, isBlended, doubleSided: it.doubleSided ?? false,
      };
    };
    const materials = new Map();
    const primitive = async (it) => {
      const key = it.material ?? -1;
      if (!materials.has(key)) materials.set(key, material(it.material));
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      const positions = accessor(it.attributes.POSITION), attributes = { 0: [positions, 3] };
      if ("NORMAL" in it.attributes) attributes[1] = [accessor(it.attributes.NORMAL), 3];
      if ("TEXCOORD_0" in it.attributes) attributes[2] = [accessor(it.attributes.TEXCOORD_0), 2];
      for (const [place, [values, width]] of Object.entries(attributes)) {
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
      }
      let count = positions.length / 3;
      if ("indices" in it) {
        const indices = Uint32Array.from(accessor(it.indices));
        count = indices.length;
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
      }
      gl.bindVertexArray(null);
      return { array, count, isIndexed: "indices" in it, material: await materials.get(key) };
    };
    const meshes = await Promise.all((json.meshes ?? []).map(async (mesh) => Promise.all(mesh.primitives.map(primitive))));
    const drawn = [], cameras = [], centers = [], walls = [];
    const walk = (index, parent) => {
      const node = json.nodes[index], world = times(parent, ofNode(node));
      const middle = [world[12], world[13], world[14]];
      const isWall = node.extras?.role === "room";
      if ("mesh" in node) {
        const { min = [0, 0, 0], max = [0, 0, 0] } = json.accessors[json.meshes[node.mesh].primitives[0].attributes.POSITION];
        const local = min.map((low, axis) => (low + max[axis]) / 2);
        const center = [0, 1, 2].map((row) => world[12 + row] + local.reduce((sum, value, axis) => sum + value * world[axis * 4 + row], 0));
        if (isWall) walls.push(center);
        for (const it of meshes[node.mesh]) drawn.push({ ...it, world, middle: center, isWall });
      }
      if ("camera" in node) cameras.push({ eye: middle, ahead: [-world[8], -world[9], -world[10]], lens: json.cameras[node.camera].perspective });
      if (node.extras?.role === "object") centers.push(middle);
      for (const child of node.children ?? []) walk(child, world);
    };
    for (const root of json.scenes[json.scene ?? 0].nodes) walk(root, ofNode({}));
    const room = [0, 1, 2].map((axis) => walls.reduce((sum, at) => sum + at[axis], 0) / Math.max(1, walls.length));
    const list = centers.length ? centers : drawn.map((it) => it.middle);
    const target = [0, 1, 2].map((axis) => list.reduce((sum, at) => sum + at[axis], 0) / Math.max(1, list.length));
    gl.useProgram(program);
    return { drawn, cameras, target, room };
  };

  // ---- Camera and drawing --------------------------------------------------------------------------------------------------
  let model = null, orbit = null, frame = 0;
  const home = (view = 0) => {
    const camera = model.cameras[Math.min(view, model.cameras.length - 1)];
    const eye = camera?.eye ?? plus(model.target, [1.2, 1.2, 1.2]);
    let target = model.target;
    // Around the point of the camera's axis that is next to the objects, so that the first image is that of the view.
    if (camera) {
      const ahead = unit(camera.ahead), way = minus(model.target, eye);
      target = plus(eye, ahead, Math.max(0.2, way[0] * ahead[0] + way[1] * ahead[1] + way[2] * ahead[2]));
    }
    const [x, y, z] = minus(eye, target), distance = Math.hypot(x, y, z) || 1;
    orbit = { target, distance, around: Math.atan2(x, z), above: Math.asin(y / distance), angle: camera?.lens?.yfov ?? 0.8 };
    redraw();
  };
  const eyeOf = ({ target, distance, around, above }) =>
    plus(target, [Math.cos(above) * Math.sin(around), Math.sin(above), Math.cos(above) * Math.cos(around)], distance);
  const redraw = () => { frame ||= requestAnimationFrame(paint); };

  let program = null, at = {};
  const paint = () => {
    frame = 0;
    if (!model || !orbit) return;
    const dense = devicePixelRatio || 1, [width, height] = [Math.round(canvas.clientWidth * dense), Math.round(canvas.clientHeight * dense)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const eye = eyeOf(orbit), near = orbit.distance / 50;
    const camera = times(perspective(orbit.angle, width / height, near, near * 5000), looking(eye, orbit.target));
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.uniformMatrix4fv(at.camera, false, camera);
    gl.uniform3fv(at.eye, eye);
    const far = (it) => Math.hypot(...minus(it.middle, eye));
    const blended = model.drawn.filter((it) => it.material.isBlended).sort((a, b) => far(b) - far(a));
    for (const it of [...model.drawn.filter((other) => !other.material.isBlended), ...blended]) {
      const { material, world } = it;
      // From outside one looks into the room: a wall that is between is left out.
      const [out, inside] = [minus(eye, it.middle), minus(model.room, it.middle)];
      if (it.isWall && out[0] * inside[0] + out[1] * inside[1] + out[2] * inside[2] < 0) continue;
      gl[material.isBlended ? "enable" : "disable"](gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthMask(!material.isBlended);
      gl[material.doubleSided ? "disable" : "enable"](gl.CULL_FACE);
      gl.uniformMatrix4fv(at.world, false, world);
      gl.uniformMatrix3fv(at.turn, false, [0, 1, 2].flatMap((column) => {
        const axis = [world[column * 4], world[column * 4 + 1], world[column * 4 + 2]], square = axis.reduce((sum, value) => sum + value * value, 0) || 1;
        return axis.map((value) => value / square);
      }));
      gl.uniform4fv(at.base, material.base);
      gl.uniform4fv(at.mapping, material.mapping);
      gl.uniform1f(at.rotation, material.rotation);
      gl.uniform3fv(at.emitted, material.emitted);
      gl.uniform1f(at.cutoff, material.cutoff);
      gl.uniform1f(at.opaque, material.isBlended ? 0 : 1);
      gl.bindTexture(gl.TEXTURE_2D, material.map);
      gl.bindVertexArray(it.array);
      if (it.isIndexed) gl.drawElements(gl.TRIANGLES, it.count, gl.UNSIGNED_INT, 0);
      else gl.drawArrays(gl.TRIANGLES, 0, it.count);
    }
    gl.depthMask(true);
    canvas.dataset.painted = String(1 + Number(canvas.dataset.painted ?? 0));
  };

  const turn = (around, above) => {
    orbit.around += around;
    orbit.above = Math.min(1.55, Math.max(-1.55, orbit.above + above));
    redraw();
  };
  const zoom = (factor) => {
    orbit.distance = Math.min(100, Math.max(0.05, orbit.distance * factor));
    redraw();
  };
  const pan = (dx, dy) => {
    const eye = eyeOf(orbit), ahead = unit(minus(orbit.target, eye)), right = unit(cross(ahead, [0, 1, 0])), up = cross(right, ahead);
    orbit.target = plus(plus(orbit.target, right, dx * orbit.distance), up, dy * orbit.distance);
    redraw();
  };
  canvas.addEventListener("keydown", (event) => {
    if (!orbit || event.ctrlKey || event.metaKey || event.altKey) return;
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key in moves) {
      const [x, y] = moves[event.key];
      if (event.shiftKey) pan(0.05 * x, 0.05 * y); else turn(0.12 * x, 0.1 * y);
    } else if (event.key === "+" || event.key === "=") zoom(0.88);
    else if (event.key === "-") zoom(1 / 0.88);
    else if (event.key === "r" || event.key === "R") home();
    else return;
    event.preventDefault();
  });
  const held = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, event);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before || !orbit) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (held.size === 2) {
      const other = [...held.values()].find((it) => it.pointerId !== event.pointerId);
      const apart = (it) => Math.hypot(it.clientX - other.clientX, it.clientY - other.clientY) || 1;
      zoom(apart(before) / apart(event));
    } else if (event.shiftKey || event.buttons === 2) pan(-dx / canvas.clientHeight, dy / canvas.clientHeight);
    else turn(-dx / 160, dy / 160);
    held.set(event.pointerId, event);
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (orbit) zoom(Math.exp(event.deltaY * 0.0012));
  }, { passive: false });
  new ResizeObserver(redraw).observe(canvas);
  by("home").addEventListener("click", () => model && home());

  const show = async () => {
    const named = state().get("scene"), known = [...choice.options].map((option) => option.value);
    choice.value = known.includes(named) ? named : known[0];
    const scene = choice.value;
    delete canvas.dataset.ready;
    says.hidden = false;
    says.textContent = `Scene ${scene} is loaded …`;
    const text = await get(`scene/${scene.padStart(6, "0")}`);
    const loaded = await load(text, program);
    if (scene !== choice.value) return;
    model = loaded;
    home(Number(state().get("view") ?? 0) || 0);
    says.hidden = true;
    canvas.dataset.ready = scene;
  };
  if (gl) {
    program = compile();
    gl.useProgram(program);
    for (const name of ["world", "camera", "turn", "mapping", "rotation", "base", "emitted", "eye", "cutoff", "opaque"]) at[name] = gl.getUniformLocation(program, name);
    choice.addEventListener("change", () => {
      setState({ scene: choice.value, view: null });
      show().catch(syntable.fail);
    });
    addEventListener("hashchange", () => show().catch(syntable.fail));
    show().catch((error) => {
      says.hidden = true;
      syntable.fail(error);
    });
  } else says.textContent = "This browser has no WebGL 2, which the scene needs.";
}
