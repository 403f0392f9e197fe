// Meshes drawn by WebGL 2: one light from the side, so that folds throw shade.

const VERTEX = `#version 300 es
in vec3 position;
in vec3 normal;
in float level;
uniform mat4 project;
uniform mat3 turn;
out vec3 side;
out float value;
uniform float scale;
void main() {
  gl_Position = project * vec4(position, 1.0);
  side = turn * normal;
  value = scale * level * level;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 side;
in float value;
uniform sampler2D colours;
uniform vec3 plain;
uniform bool coloured;
out vec4 colour;
void main() {
  vec3 n = normalize(side) * (gl_FrontFacing ? 1.0 : -1.0);
  vec3 base = coloured ? texture(colours, vec2(clamp(value, 0.002, 0.998), 0.5)).rgb : plain;
  base = pow(base, vec3(2.2)) * (gl_FrontFacing ? 1.0 : 0.55);
  float key = max(dot(n, normalize(vec3(-0.84, 0.4, 0.34))), 0.0);
  float fill = max(dot(n, normalize(vec3(0.85, 0.1, 0.5))), 0.0);
  float sky = 0.5 + 0.5 * n.y;
  float edge = mix(0.72, 1.0, smoothstep(0.0, 0.55, abs(n.z)));
  vec3 lit = base * edge * (0.15 + 0.14 * sky + 1.0 * key + 0.17 * fill);
  colour = vec4(pow(lit, vec3(1.0 / 2.2)), 1.0);
}`;

class Drawing {
  constructor(canvas) {
    const gl = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error('This browser shows no WebGL 2: garments cannot be drawn. Plots and tables work.');
    this.gl = gl;
    this.canvas = canvas;
    this.program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    ['position', 'normal', 'level'].forEach((name, k) => gl.bindAttribLocation(this.program, k, name));
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(this.program));
    gl.useProgram(this.program);
    this.at = {};
    for (const name of ['project', 'turn', 'scale', 'plain', 'coloured']) {
      this.at[name] = gl.getUniformLocation(this.program, name);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  // stops: [r, g, b] of 0 to 255, evenly spaced.
  setColours(stops) {
    const gl = this.gl;
    const row = new Uint8Array(256 * 4);
    for (let k = 0; k < 256; k++) {
      const place = (k / 255) * (stops.length - 1);
      const first = Math.min(Math.floor(place), stops.length - 2);
      for (let c = 0; c < 3; c++) {
        row[4 * k + c] = stops[first][c] + (place - first) * (stops[first + 1][c] - stops[first][c]);
      }
      row[4 * k + 3] = 255;
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, row);
  }

  mesh(faces, count) {
    const gl = this.gl;
    const mesh = {
      array: gl.createVertexArray(), faces, buffers: [], index: gl.createBuffer(),
      positions: new Float32Array(3 * count), normals: new Float32Array(3 * count), frame: -1,
    };
    gl.bindVertexArray(mesh.array);
    [[3, gl.FLOAT, 12], [3, gl.FLOAT, 12], [1, gl.UNSIGNED_BYTE, 1]].forEach(([parts, kind, bytes], k) => {
      mesh.buffers.push(gl.createBuffer());
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[k]);
      gl.bufferData(gl.ARRAY_BUFFER, bytes * count, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, parts, kind, kind === gl.UNSIGNED_BYTE, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    return mesh;
  }

  free(mesh) {
    this.gl.deleteVertexArray(mesh.array);
    for (const buffer of [...mesh.buffers, mesh.index]) this.gl.deleteBuffer(buffer);
  }

  // The frame of positions, and of values where a colour is asked for.
  update(mesh, positions, frame, values) {
    const gl = this.gl;
    if (mesh.frame !== frame) {
      positionsAt(positions, frame, mesh.positions);
      normalsOf(mesh.positions, mesh.faces, mesh.normals);
      [mesh.positions, mesh.normals].forEach((numbers, k) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[k]);
        gl.bufferSubData(gl.ARRAY_BUFFER, 0, numbers);
      });
      mesh.frame = frame;
    }
    if (values) {
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[2]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, values.levels, frame * values.count, values.count);
    }
  }

  // rectangle: [left, top, width, height] in pixels of the page; background: [r, g, b] of 0 to 1.
  begin(rectangle, background) {
    const gl = this.gl;
    const ratio = this.canvas.width / this.canvas.clientWidth;
    const [left, top, width, height] = rectangle.map((x) => Math.round(x * ratio));
    const place = [left, this.canvas.height - top - height, width, height];
    gl.viewport(...place);
    gl.scissor(...place);
    gl.clearColor(...background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  // What is drawn from now on hides all that was drawn before.
  forgetDepth() {
    this.gl.clear(this.gl.DEPTH_BUFFER_BIT);
  }

  draw(mesh, camera, plain, values, limit) {
    const gl = this.gl;
    gl.uniformMatrix4fv(this.at.project, false, camera.project);
    gl.uniformMatrix3fv(this.at.turn, false, camera.turn);
    gl.uniform3fv(this.at.plain, plain);
    gl.uniform1i(this.at.coloured, values ? 1 : 0);
    if (values) gl.uniform1f(this.at.scale, values.full / limit);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.faces.length, gl.UNSIGNED_INT, 0);
  }
}
