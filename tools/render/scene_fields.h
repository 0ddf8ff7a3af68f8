/* Reading JSON objects strictly: every key is asked for by name and within bounds, and what was not
 * asked for is refused (unless it begins with x_). Every complaint names the file and the key. */
#ifndef RENDER_SCENE_FIELDS_H
#define RENDER_SCENE_FIELDS_H

#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace render {

class Fields {
public:
    // `where` is the file and the object's place in it, for complaints.
    Fields(const nlohmann::json& object, std::string where);

    bool has(const char* key) const;
    const std::string& where() const { return where_; }
    [[noreturn]] void complain(const char* key, const std::string& what) const;

    double number(const char* key, double low, double high);
    double number_or(const char* key, double low, double high, double otherwise);
    std::int64_t integer(const char* key, std::int64_t low, std::int64_t high);
    std::int64_t integer_or(const char* key, std::int64_t low, std::int64_t high,
                            std::int64_t otherwise);
    std::string text(const char* key);
    std::string text_or(const char* key, const char* otherwise);
    std::vector<double> numbers(const char* key, std::size_t count_low, std::size_t count_high,
                                double magnitude);
    Eigen::Vector3d vector_or(const char* key, const Eigen::Vector3d& otherwise);
    Fields object(const char* key);
    std::vector<Fields> objects(const char* key, std::size_t count_low, std::size_t count_high);
    const nlohmann::json& raw(const char* key);

    // Complains about the first key that nobody asked for.
    void finish() const;

private:
    nlohmann::json object_; // a copy: defaults are merged into it by the caller
    std::string where_;
    std::set<std::string> asked_;
};

} // namespace render

#endif
