// Any bytes as a rig.json: refused with a sentence that names it, or lenses that project and unproject without
// harm, whatever their numbers.
#include <string>

#include "host/report/rig_file.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

void use(const rig::RigCamera& camera) {
  fuzz_require(camera.width_px > 0 && camera.height_px > 0 && !camera.name.empty());
  for (int i = 0; i < 3; i++) {
    const Eigen::Vector2d pixel(camera.width_px * 0.5 * i, camera.height_px * 0.25 * (2 - i));
    const Eigen::Vector3d ray = camera.lens.unproject(pixel);
    (void)camera.lens.project(1000.0 * ray);
    (void)camera.lens.project(Eigen::Vector3d(100.0 * i, -70.0 * i, 500.0 - 400.0 * i));
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  const std::string path = fuzz_file(data, count);
  const auto file = rig::read_rig_file(path);
  if (!file.ok()) {
    fuzz_require(file.sentence().compare(0, path.size(), path) == 0);
    return 0;
  }
  for (const rig::RigCamera& camera : file.value().cameras) {
    use(camera);
    fuzz_require(rig::find_camera(file.value(), camera.name).ok());
  }
  fuzz_require(!rig::find_camera(file.value(), "no camera\t").ok());
  (void)rig::in_parts(file.value());
  (void)rig::volume_grid(file.value(), 3);
  return 0;
}
