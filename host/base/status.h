// How functions of the host tell success from failure: a failure is one plain sentence for the
// user, which names the file, line or field at fault and what to do. Exceptions do not cross a stage.
#ifndef TESSERA_HOST_BASE_STATUS_H
#define TESSERA_HOST_BASE_STATUS_H

#include <cassert>
#include <optional>
#include <string>
#include <utility>

namespace rig {

class [[nodiscard]] Status {
 public:
  Status() = default;  // success
  static Status failure(std::string sentence) {
    assert(!sentence.empty());
    Status status;
    status.sentence_ = std::move(sentence);
    return status;
  }
  bool ok() const { return sentence_.empty(); }
  const std::string& sentence() const { return sentence_; }

 private:
  std::string sentence_;
};

// A value, or the sentence that says why there is none.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : value_(std::move(value)) {}                          // NOLINT: meant to convert
  Result(Status failure) : status_(std::move(failure)) { assert(!status_.ok()); }  // NOLINT
  bool ok() const { return value_.has_value(); }
  const Status& status() const { return status_; }
  const std::string& sentence() const { return status_.sentence(); }
  T& value() {
    assert(ok());
    return *value_;
  }
  const T& value() const {
    assert(ok());
    return *value_;
  }

 private:
  std::optional<T> value_;
  Status status_;
};

}  // namespace rig

#endif
