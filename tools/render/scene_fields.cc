/* Strict JSON objects. */
#include "tools/render/scene_fields.h"

#include <cmath>

#include <fmt/format.h>

#include "tools/render/render_scene.h"

namespace render {

using nlohmann::json;

Fields::Fields(const json& object, std::string where) : object_(object), where_(std::move(where))
{
    if (!object_.is_object()) {
        throw UserError(fmt::format("{}: an object {{...}} is expected here", where_));
    }
}

bool Fields::has(const char* key) const
{
    return object_.contains(key);
}

void Fields::complain(const char* key, const std::string& what) const
{
    throw UserError(fmt::format("{}: `{}` {}", where_, key, what));
}

const json& Fields::raw(const char* key)
{
    asked_.insert(key);
    const auto at = object_.find(key);
    if (at == object_.end()) {
        complain(key, "is missing");
    }
    return *at;
}

double Fields::number(const char* key, double low, double high)
{
    const json& value = raw(key);
    const double number = value.is_number() ? value.get<double>() : std::nan("");
    if (!(number >= low && number <= high)) {
        complain(key, fmt::format("must be a number from {} to {}", low, high));
    }
    return number;
}

double Fields::number_or(const char* key, double low, double high, double otherwise)
{
    return has(key) ? number(key, low, high) : otherwise;
}

std::int64_t Fields::integer(const char* key, std::int64_t low, std::int64_t high)
{
    const json& value = raw(key);
    const bool whole = value.is_number_integer() &&
                       !(value.is_number_unsigned() && value.get<std::uint64_t>() > INT64_MAX);
    if (!whole || value.get<std::int64_t>() < low || value.get<std::int64_t>() > high) {
        complain(key, fmt::format("must be a whole number from {} to {}", low, high));
    }
    return value.get<std::int64_t>();
}

std::int64_t Fields::integer_or(const char* key, std::int64_t low, std::int64_t high,
                                std::int64_t otherwise)
{
    return has(key) ? integer(key, low, high) : otherwise;
}

std::string Fields::text(const char* key)
{
    const json& value = raw(key);
    if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
        complain(key, "must be a text that is not empty");
    }
    return value.get<std::string>();
}

std::string Fields::text_or(const char* key, const char* otherwise)
{
    return has(key) ? text(key) : std::string(otherwise);
}

std::vector<double> Fields::numbers(const char* key, std::size_t count_low, std::size_t count_high,
                                    double magnitude)
{
    const json& value = raw(key);
    bool good = value.is_array() && value.size() >= count_low && value.size() <= count_high;
    std::vector<double> out;
    for (std::size_t i = 0; good && i < value.size(); i++) {
        good = value[i].is_number() && std::abs(value[i].get<double>()) <= magnitude;
        if (good) {
            out.push_back(value[i].get<double>());
        }
    }
    if (!good) {
        const std::string count = count_low == count_high
                                      ? fmt::format("{}", count_low)
                                      : fmt::format("{} to {}", count_low, count_high);
        complain(key, fmt::format("must be a list of {} numbers, none beyond {}", count, magnitude));
    }
    return out;
}

Eigen::Vector3d Fields::vector_or(const char* key, const Eigen::Vector3d& otherwise)
{
    if (!has(key)) {
        return otherwise;
    }
    const std::vector<double> list = numbers(key, 3, 3, 1e6);
    return {list[0], list[1], list[2]};
}

Fields Fields::object(const char* key)
{
    return {raw(key), fmt::format("{}, {}", where_, key)};
}

std::vector<Fields> Fields::objects(const char* key, std::size_t count_low, std::size_t count_high)
{
    const json& value = raw(key);
    if (!value.is_array() || value.size() < count_low || value.size() > count_high) {
        complain(key, fmt::format("must be a list of {} to {} objects", count_low, count_high));
    }
    std::vector<Fields> out;
    for (std::size_t i = 0; i < value.size(); i++) {
        out.emplace_back(value[i], fmt::format("{}, {}[{}]", where_, key, i));
    }
    return out;
}

void Fields::finish() const
{
    for (const auto& item : object_.items()) {
        if (asked_.count(item.key()) == 0 && item.key().rfind("x_", 0) != 0) {
            complain(item.key().c_str(), "is not a key that is known here");
        }
    }
}

} // namespace render
