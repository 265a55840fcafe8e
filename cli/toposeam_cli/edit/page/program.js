// Programs that fill the viewport.
const VERTEX = `#version 300 es
void main() { vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4. - 1.; gl_Position = vec4(p, 0, 1); }`;

// Compiles and links a program; `at` finds its uniforms.
export function program(gl, fragment) {
  const own = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(own, shader);
  }
  gl.linkProgram(own);
  const places = new Map();
  return { own, at: name => { if (!places.has(name)) places.set(name, gl.getUniformLocation(own, name)); return places.get(name); } };
}
