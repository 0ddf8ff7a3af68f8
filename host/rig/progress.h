// Lines for the user on standard error; on a terminal with a line of progress that is written over.
#ifndef TESSERA_HOST_RIG_PROGRESS_H
#define TESSERA_HOST_RIG_PROGRESS_H

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <string>

namespace rig {

class Progress {
 public:
  explicit Progress(bool quiet) : quiet_(quiet), is_terminal_(isatty(STDERR_FILENO) != 0) {}

  // Says one thing for good.
  void line(const std::string& text) {
    if (!quiet_) fmt::print(stderr, "{}tessera-rig: {}\n", is_terminal_ ? "\r\033[K" : "", text);
  }

  // Says how things stand, a few times a second, where someone is looking.
  template <typename Text>
  void show(const Text& text) {
    const auto now = std::chrono::steady_clock::now();
    if (quiet_ || !is_terminal_ || now - shown_ < std::chrono::milliseconds(250)) return;
    shown_ = now;
    fmt::print(stderr, "\r\033[K{}", text());
    std::fflush(stderr);
  }

 private:
  bool quiet_, is_terminal_;
  std::chrono::steady_clock::time_point shown_;
};

}  // namespace rig

#endif
