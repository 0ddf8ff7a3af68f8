// Any bytes as an observation folder: refused with a sentence, or a scene whose every index and number holds.
// The bytes are scene.json, observations.csv and points.csv, a byte 0xff between them.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "host/obs/scene.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

struct Folder {
  std::string path;
  Folder() {
    char name[] = "/tmp/fuzz_scene_XXXXXX";
    fuzz_require(mkdtemp(name) != nullptr);
    path = name;
    write("target.json",
          "{\"format\": \"tessera-target\", \"version\": 1, \"name\": \"t\", \"rows\": 1, \"cols\": 2, "
          "\"patch_mm\": 50, \"levels\": 2, \"ids\": [[5, 9]], \"turns\": [[0, 1]]}");
  }
  ~Folder() { std::filesystem::remove_all(path); }
  void write(const char* name, const std::string& text) const {
    std::ofstream(path + "/" + name, std::ios::binary | std::ios::trunc) << text;
  }
};

void check(const rig::Scene& scene) {
  fuzz_require(!scene.cameras.empty());
  for (const rig::SceneCamera& camera : scene.cameras) {
    fuzz_require(camera.width_px > 0 && camera.height_px > 0);
  }
  for (const rig::Board& board : scene.boards) {
    fuzz_require(board.group >= 0 && board.group < static_cast<int>(scene.boards.size()));
    for (const rig::BoardPoint& point : board.points) {
      fuzz_require(point.at_mm.allFinite() && std::isfinite(point.radius_mm) && point.radius_mm >= 0);
    }
  }
  for (const rig::Observation& o : scene.observations) {
    fuzz_require(o.camera >= 0 && o.camera < static_cast<int>(scene.cameras.size()));
    fuzz_require(o.board >= 0 && o.board < static_cast<int>(scene.boards.size()));
    fuzz_require(o.point < scene.boards[static_cast<size_t>(o.board)].points.size());
    fuzz_require(o.pixel.allFinite() && std::isfinite(o.sigma_px) && o.sigma_px >= 0);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  static const Folder folder;
  const char* const names[] = {"scene.json", "observations.csv", "points.csv"};
  const uint8_t* const end = data + count;
  for (const char* name : names) {
    const uint8_t* const stop = std::find(data, end, 0xff);
    folder.write(name, std::string(data, stop));
    data = stop == end ? end : stop + 1;
  }
  const auto scene = rig::read_scene(folder.path);
  if (scene.ok()) {
    check(scene.value());
  } else {
    fuzz_require(scene.sentence().find('\n') == std::string::npos);
  }
  return 0;
}
