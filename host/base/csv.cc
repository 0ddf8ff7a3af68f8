// See csv.h. Numbers are read without locale, and a cell must be a number to its last character.
#include "host/base/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

namespace rig {
namespace {

constexpr std::size_t kNowhere = std::numeric_limits<std::size_t>::max();

std::string_view trim(std::string_view text)
{
    const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    while (!text.empty() && blank(text.front())) {
        text.remove_prefix(1);
    }
    while (!text.empty() && blank(text.back())) {
        text.remove_suffix(1);
    }
    return text;
}

void split(std::string_view text, std::vector<std::string_view>* cells)
{
    cells->clear();
    std::size_t comma = 0;
    while ((comma = text.find(',')) != std::string_view::npos) {
        cells->push_back(trim(text.substr(0, comma)));
        text.remove_prefix(comma + 1);
    }
    cells->push_back(trim(text));
}

}  // namespace

CsvReader::CsvReader(std::istream& in, std::string source) : in_(&in), source_(std::move(source)) {}

CsvReader::CsvReader(std::string_view text, std::string source)
    : rest_(text), source_(std::move(source))
{
}

bool CsvReader::read_line()
{
    if (in_ != nullptr) {
        if (!std::getline(*in_, line_text_)) {
            return false;
        }
        text_ = line_text_;
    } else {
        if (rest_.empty()) {
            return false;
        }
        const std::size_t end = std::min(rest_.find('\n'), rest_.size());
        text_ = rest_.substr(0, end);
        rest_.remove_prefix(std::min(end + 1, rest_.size()));
    }
    ++line_;
    return true;
}

Status CsvReader::header(const std::vector<std::string>& required,
                         const std::vector<std::string>& optional)
{
    if (!read_line()) {
        return Status::failure(source_ + " is empty; it needs a header line");
    }
    std::string_view text = text_;
    // A byte order mark that spreadsheets put in front is not part of the first name.
    if (text.substr(0, 3) == "\xef\xbb\xbf") {
        text.remove_prefix(3);
    }
    split(text, &cells_);
    width_ = cells_.size();
    names_ = required;
    names_.insert(names_.end(), optional.begin(), optional.end());
    places_.assign(names_.size(), kNowhere);
    for (std::size_t i = 0; i < names_.size(); ++i) {
        const auto found = std::find(cells_.begin(), cells_.end(), names_[i]);
        if (found != cells_.end()) {
            places_[i] = static_cast<std::size_t>(found - cells_.begin());
            if (std::find(found + 1, cells_.end(), names_[i]) != cells_.end()) {
                return complain("column '" + names_[i] + "' stands twice in the header");
            }
        } else if (i < required.size()) {
            return complain("the header has no column '" + names_[i] + "'");
        }
    }
    return Status();
}

bool CsvReader::next()
{
    while (status_.ok() && read_line()) {
        if (trim(text_).empty()) {
            continue;
        }
        split(text_, &cells_);
        if (cells_.size() == width_) {
            return true;
        }
        status_ = complain("has " + std::to_string(cells_.size()) + " fields, the header has "
                           + std::to_string(width_));
    }
    if (status_.ok() && in_ != nullptr && in_->bad()) {
        status_ = Status::failure("cannot read " + source_);
    }
    return false;
}

bool CsvReader::has(std::size_t column) const
{
    return places_[column] != kNowhere;
}

std::string_view CsvReader::cell(std::size_t column) const
{
    return has(column) ? cells_[places_[column]] : std::string_view();
}

bool CsvReader::number(std::size_t column, double* value)
{
    if (number_or_nan(column, value) && !std::isfinite(*value)) {
        status_ = complain("column '" + names_[column] + "': '" + std::string(cell(column))
                           + "' is not a finite number");
    }
    return status_.ok();
}

bool CsvReader::number_or_nan(std::size_t column, double* value)
{
    const std::string_view text = cell(column);
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), *value);
    if (fault != std::errc() || end != text.data() + text.size()) {
        status_ = complain("column '" + names_[column] + "': '" + std::string(text)
                           + "' is not a number");
        return false;
    }
    return true;
}

bool CsvReader::integer(std::size_t column, std::int64_t* value)
{
    const std::string_view text = cell(column);
    std::int64_t read = 0;
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), read);
    if (fault != std::errc() || end != text.data() + text.size()) {
        status_ = complain("column '" + names_[column] + "': '" + std::string(text)
                           + "' is not an integer");
        return false;
    }
    *value = read;
    return true;
}

Status CsvReader::complain(const std::string& what) const
{
    return Status::failure(source_ + " line " + std::to_string(line_) + ": " + what);
}

}  // namespace rig
