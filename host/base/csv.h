// Comma-separated files with a header line: columns are found by name, and every complaint names
// the source and the line. No quoting: the project's tables hold names without commas and numbers.
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <string_view>
#include <vector>

#include "host/base/status.h"

namespace rig {

class CsvReader {
public:
    // Borrows its input; `source` is what sentences call the file.
    CsvReader(std::istream& in, std::string source);
    CsvReader(std::string_view text, std::string source);

    // Reads the header line. Fails when a required column is missing or one stands twice. Columns
    // that are in neither list are left alone.
    Status header(const std::vector<std::string>& required, const std::vector<std::string>& optional);

    // Next row that is not empty; false at the end, and after a fault, which status() then tells.
    bool next();
    const Status& status() const { return status_; }

    bool has(std::size_t column) const;  // columns counted through required, then optional
    std::string_view cell(std::size_t column) const;  // empty when an optional one is absent
    std::int64_t line() const { return line_; }

    // The cell as a number; on failure stores the sentence in status() and returns false.
    bool number(std::size_t column, double* value);         // finite
    bool number_or_nan(std::size_t column, double* value);  // any, nan and inf too
    bool integer(std::size_t column, std::int64_t* value);

    // A sentence about the present line: "FILE line N: WHAT".
    Status complain(const std::string& what) const;

private:
    bool read_line();

    std::istream* in_ = nullptr;  // or else:
    std::string_view rest_;
    std::string source_;
    std::string line_text_;
    std::string_view text_;  // the present line
    std::vector<std::string_view> cells_;
    std::vector<std::string> names_;
    std::vector<std::size_t> places_;
    std::size_t width_ = 0;
    std::int64_t line_ = 0;
    Status status_;
};

}  // namespace rig
