# The scene of the scripts under tests: a ball and a moving camera, in NAME.toml. Sourced.
scene() { # NAME [RADIUS [WIDTH HEIGHT]]
  cat >"$1.toml" <<T
format = 1
[image]
width = ${3:-160}
height = ${4:-120}
spp = 64
[camera]
type = "pinhole"
eye = { keys = [[1, [0, 1, 6]], [100, [3, 2, 5]]] }
target = [0, 0.5, 0]
vfov = 40
[materials.clay]
type = "diffuse"
[[lights]]
type = "point"
position = [3, 5, 4]
intensity = [90, 90, 90]
[[shapes]]
type = "sphere"
center = [0, 1, 0]
radius = ${2:-1}
material = "clay"
T
}
