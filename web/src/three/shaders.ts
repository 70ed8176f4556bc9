/** The page's own shaders: one light from above the viewer's left shoulder, colours by vertex. */

export const VERTEX = `
in vec3 position;
in vec3 normal;
in vec3 color;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
out vec3 vColour;
out vec3 vNormal;
void main() {
  vColour = color;
  vNormal = mat3(modelViewMatrix) * normal;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

export const FRAGMENT = `
precision highp float;
in vec3 vColour;
in vec3 vNormal;
uniform float opacity;
uniform float shading;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  float light = 0.62 + 0.45 * abs(dot(n, normalize(vec3(-0.45, 0.75, 0.6))));
  colour = vec4(vColour * mix(1.0, light, shading), opacity);
}`;

export const LINE_VERTEX = `
in vec3 position;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`;

export const LINE_FRAGMENT = `
precision highp float;
uniform vec3 tint;
out vec4 colour;
void main() { colour = vec4(tint, 1.0); }`;
