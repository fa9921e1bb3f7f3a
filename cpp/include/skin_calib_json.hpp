// Read calibration files (version 3) and noise files. Needs nlohmann-json 3. Nothing is thrown: a status says what is
// wrong. The reader checks all that the runtime needs; "skin-calib check" checks everything, and the checksum.
#pragma once

#include <charconv>
#include <cstdio>
#include <fstream>
#include <new>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <unordered_map>

#include "skin_calib.hpp"
#include "skin_calib/sha256.hpp"

namespace skin_calib {
namespace reading {

using Json = nlohmann::json;

// Limits of a file, as in Python. Larger: a hostile file uses more memory.
inline constexpr std::size_t max_bytes = std::size_t{512} << 20, max_values = std::size_t{1} << 24, max_depth = 32;

// Throws inside of this header only: the public functions return it as a status.
struct Wrong {
    std::string message;
};

// Return a member of an object.
inline const Json& member(const Json& object, const char* name) {
    if (!object.is_object())
        throw Wrong{std::string("an object with '") + name + "' is expected, not " + object.type_name()};
    const auto found = object.find(name);
    if (found == object.end()) throw Wrong{std::string("'") + name + "' is missing"};
    return *found;
}

// Return a list with `count` items; any number of items if it is 0.
inline const Json& list(const Json& value, const char* name, std::size_t count = 0) {
    if (!value.is_array()) throw Wrong{std::string("'") + name + "' must be a list"};
    if (count != 0 && value.size() != count)
        throw Wrong{std::string("'") + name + "' has " + std::to_string(value.size()) + " items, not " +
                    std::to_string(count)};
    return value;
}

inline const Json& list_of(const Json& object, const char* name, std::size_t count = 0) {
    return list(member(object, name), name, count);
}

// Return a finite number; `if_null` for null, if null is allowed.
inline double number(const Json& value, const char* name, std::optional<double> if_null = std::nullopt) {
    if (value.is_null() && if_null) return *if_null;
    if (!value.is_number()) throw Wrong{std::string("'") + name + "' must have numbers"};
    return value.get<double>();
}

inline std::int64_t whole(const Json& value, const char* name) {
    const double x = number(value, name);
    if (!(std::abs(x) <= 2147483648.0) || x != std::floor(x))
        throw Wrong{std::string("'") + name + "' must have whole numbers of 32 bits"};
    return static_cast<std::int64_t>(x);
}

inline std::string text(const Json& value, const char* name) {
    if (!value.is_string()) throw Wrong{std::string("'") + name + "' must be a text"};
    return value.get<std::string>();
}

inline Numbers numbers(const Json& value, const char* name, std::size_t count = 0,
                       std::optional<double> if_null = std::nullopt) {
    Numbers result;
    for (const Json& x : list(value, name, count)) result.push_back(number(x, name, if_null));
    return result;
}

inline Vec3 vector(const Json& value, const char* name) {
    const Numbers x = numbers(value, name, 3);
    return {x[0], x[1], x[2]};
}

// Refuse a file of another format or version.
inline void check_format(const Json& document, const char* format, int version) {
    if (text(member(document, "format"), "format") != format)
        throw Wrong{std::string("the format must be '") + format + "', not " +
                    member(document, "format").dump().substr(0, 80)};
    if (whole(member(document, "version"), "version") != version)
        throw Wrong{"the version must be " + std::to_string(version) +
                    "; load an older file in Python, and save it again"};
}

inline Response response_of(const Json& document) {
    Response response;
    const std::string kind = text(member(document, "kind"), "kind");
    if (kind == "table") {
        response.readings = numbers(member(document, "readings"), "readings");
        response.forces = numbers(member(document, "forces"), "forces");
        if (response.readings.empty()) throw Wrong{"a table of a response is empty"};
    } else if (kind == "polynomial") {
        response.coefficients = numbers(member(document, "coefficients"), "coefficients");
        if (document.contains("range")) {
            const Numbers range = numbers(document["range"], "range", 2);
            response.range = Vec2{range[0], range[1]};
        }
    } else {
        throw Wrong{"the kind of a response must be 'polynomial' or 'table'"};
    }
    return response;
}

// Return the exact unit vector instead of one of single precision; up to the rounding of the file its bits stay.
inline Vec3 restored(const Vec3& stored, const Vec3& exact) {
    constexpr double stored_rounding = 1e-9;
    const Vec3 error = plus(stored, exact, -1);
    const bool is_rounded =
        std::any_of(error.begin(), error.end(), [](double x) { return std::abs(x) > stored_rounding; });
    return is_rounded && std::abs(std::sqrt(dot(stored, stored)) - 1) <= single_rounding ? exact : stored;
}

// Add the taxels of one patch.
inline void add_patch(const Json& patch, std::size_t link_responses, Calibration& c,
                      std::vector<std::vector<std::string>>& near) {
    const Json& taxels = member(patch, "taxels");
    const std::size_t n = list_of(taxels, "id").size();
    if (n == 0) throw Wrong{"a patch has no taxels"};
    for (const Json& id : list_of(taxels, "id", n)) c.ids.push_back(text(id, "id"));
    for (const Json& x : list_of(taxels, "channel", n)) c.channels.push_back(whole(x, "channel"));
    for (const Json& p : list_of(taxels, "position", n)) c.positions.push_back(vector(p, "position"));
    for (const Json& p : list_of(taxels, "normal", n)) {
        const Vec3 normal = vector(p, "normal");
        c.normals.push_back(restored(normal, unit(normal)));
    }
    for (const Json& p : list_of(taxels, "tangent", n)) {
        const Vec3 tangent = vector(p, "tangent"), normal = unit(c.normals[c.tangents.size()]);
        c.tangents.push_back(restored(tangent, unit(plus(tangent, normal, -dot(tangent, normal)))));
    }
    constexpr Vec3 unknown{not_a_number, not_a_number, not_a_number};
    if (taxels.contains("sigma"))
        for (const Json& p : list_of(taxels, "sigma", n)) c.sigma.push_back(p.is_null() ? unknown : vector(p, "sigma"));
    c.sigma.resize(c.ids.size(), unknown);
    double area = 0;
    for (const Json& x : list_of(taxels, "area", n)) c.areas.push_back(number(x, "area")), area += c.areas.back();
    c.max_load += patch.contains("max_load") ? number(patch["max_load"], "max_load") : std::max(2e5 * area, 100.0);
    for (const Json& cell : list_of(taxels, "corners", n)) {
        c.corners.emplace_back();
        for (const Json& p : list(cell, "corners")) c.corners.back().push_back(vector(p, "corners"));
    }
    for (const Json& ids : list_of(taxels, "neighbours", n)) {
        near.emplace_back();
        for (const Json& id : list(ids, "neighbours")) near.back().push_back(text(id, "neighbours"));
    }
    if (!taxels.contains("response")) {
        c.response.resize(c.ids.size(), 0);
        return;
    }
    for (const Json& x : list_of(taxels, "response", n)) {
        const std::int64_t k = whole(x, "response");
        if (k < 0 || static_cast<std::size_t>(k) >= link_responses)
            throw Wrong{"a taxel has a response that is not in the list"};
        c.response.push_back(static_cast<std::int32_t>(k + 1));
    }
}

inline Calibration calibration_of(const Json& document) {
    check_format(document, "skin-calibration", 3);
    Calibration c;
    c.link = text(member(document, "link"), "link");
    c.checksum = text(member(document, "checksum"), "checksum");
    c.responses.push_back(response_of(member(document, "response")));
    if (document.contains("responses"))
        for (const Json& r : list(document["responses"], "responses")) c.responses.push_back(response_of(r));
    if (document.contains("modalities"))
        for (const Json& m : list(document["modalities"], "modalities"))
            c.modalities.push_back(text(member(m, "name"), "name").substr(0, 80));
    std::vector<std::vector<std::string>> near;
    c.max_load = 0;
    for (const Json& patch : list_of(document, "patches")) add_patch(patch, c.responses.size() - 1, c, near);
    std::unordered_map<std::string, std::int32_t> row;
    for (std::size_t i = 0; i < c.ids.size(); ++i)
        if (!row.emplace(c.ids[i], static_cast<std::int32_t>(i)).second)
            throw Wrong{"two taxels have the id '" + c.ids[i].substr(0, 80) + "'"};
    for (std::size_t i = 0; i < near.size(); ++i)
        for (const std::string& id : near[i]) {
            const auto other = row.find(id);
            if (other == row.end()) throw Wrong{"'neighbours' has an unknown taxel '" + id.substr(0, 80) + "'"};
            if (static_cast<std::int32_t>(i) < other->second)
                c.pairs.push_back({static_cast<std::int32_t>(i), other->second});
        }
    std::sort(c.pairs.begin(), c.pairs.end());
    c.pairs.erase(std::unique(c.pairs.begin(), c.pairs.end()), c.pairs.end());
    return c;
}

inline Noise noise_of(const Json& document, const Calibration& calibration) {
    check_format(document, "skin-noise", 1);
    const std::size_t n = calibration.ids.size();
    if (text(member(document, "calibration"), "calibration") != calibration.checksum)
        throw Wrong{"the noise is of another calibration of '" + calibration.link.substr(0, 80) +
                    "': run a tare with this one"};
    Noise noise;
    noise.baseline = numbers(member(document, "baseline"), "baseline", n);
    const Json& levels = member(document, "noise");
    if (levels.is_null()) return noise;
    noise.is_known = true;
    const std::pair<const char*, Numbers*> arrays[] = {
        {"mean", &noise.mean},       {"sigma", &noise.sigma},         {"sure", &noise.sure},
        {"lasting", &noise.lasting}, {"pair", &noise.pair},           {"possible", &noise.possible},
        {"release", &noise.release}, {"lowest", &noise.lowest},       {"slopes", &noise.slopes},
        {"free", &noise.free},       {"rectified", &noise.rectified}, {"below_clip", &noise.below_clip}};
    for (const auto& [name, values] : arrays) *values = numbers(member(levels, name), name, n);
    noise.clip = numbers(member(levels, "clip"), "clip", n, -infinity);
    noise.detection_limits = numbers(member(levels, "detection_limits"), "detection_limits", n, not_a_number);
    noise.repeats = numbers(member(levels, "repeats"), "repeats", n, infinity);
    noise.frame_repeats = number(member(levels, "frame_repeats"), "frame_repeats", infinity);
    for (const Json& x : list_of(levels, "dead", n)) {
        if (!x.is_boolean()) throw Wrong{"'dead' must have true and false only"};
        noise.dead.push_back(x.get<bool>());
    }
    const std::pair<const char*, double*> values[] = {{"free_sum", &noise.free_sum},
                                                      {"load_level", &noise.load_level},
                                                      {"common", &noise.common},
                                                      {"load_limit", &noise.load_limit}};
    for (const auto& [name, value] : values) *value = number(member(levels, name), name);
    const Numbers signs = numbers(member(levels, "sign"), "sign", n), own = TaxelResponses(calibration).sign;
    if (signs != own) throw Wrong{"'sign' is not that of the responses of the calibration"};
    return noise;
}

// Call a function, and return what it or nlohmann-json throws as a status.
template <class Function> Status caught(Function&& function) noexcept {
    try {
        return function();
    } catch (const Wrong& wrong) {
        return Status{false, wrong.message};
    } catch (const std::bad_alloc&) {
        return Status{false, "out of memory"}; // fits into the text itself: no further allocation
    } catch (const std::exception& error) {
        return Status{false, error.what()};
    }
}

// Refuse files with too many values or nesting levels before they are parsed.
inline void measure(std::string_view bytes) {
    std::size_t values = 0, depth = 0;
    bool in_text = false;
    for (std::size_t k = 0; k < bytes.size(); ++k) {
        const char c = bytes[k];
        if (in_text && c == '\\') ++k;
        if (c == '"') in_text = !in_text;
        if (in_text) continue;
        values += c == '[' || c == '{' || c == ',';
        depth += c == '[' || c == '{';
        depth -= depth > 0 && (c == ']' || c == '}');
        if (depth > max_depth) throw Wrong{"the file has more than 32 nesting levels"};
    }
    if (bytes.size() > max_bytes || values > max_values) throw Wrong{"the file has too many values"};
}

inline Json parsed(std::string_view bytes) {
    measure(bytes);
    Json document = Json::parse(bytes.begin(), bytes.end(), nullptr, false);
    if (document.is_discarded()) throw Wrong{"the file is no JSON, or is truncated"};
    return document;
}

inline std::string contents(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    if (!file || !(text << file.rdbuf())) throw Wrong{"cannot read '" + path + "'"};
    return text.str();
}

// Return a number as Python writes it, null if it is not finite: the checksum depends on each digit.
inline std::string as_json(double x) {
    if (!std::isfinite(x)) return "null";
    char buffer[64];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, x, std::chars_format::scientific).ptr;
    const std::string text(buffer, end);
    const std::size_t e = text.find('e'), first = text[0] == '-' ? 1 : 0;
    const int exponent = std::atoi(text.c_str() + e + 1);
    if (exponent < -4 || exponent >= 16) return text; // the exponent has two digits at least in both languages
    std::string digits = text.substr(first, 1) + (e > first + 1 ? text.substr(first + 2, e - first - 2) : "");
    const auto whole = static_cast<std::size_t>(std::max(exponent, 0)) + 1;
    if (exponent < 0) digits.insert(0, static_cast<std::size_t>(-exponent), '0');
    if (digits.size() < whole + 1) digits.append(whole + 1 - digits.size(), '0');
    return text.substr(0, first) + digits.substr(0, whole) + "." + digits.substr(whole);
}

inline std::string as_json(const Numbers& values) {
    std::string text = "[";
    for (double x : values) text += (text.size() > 1 ? "," : "") + as_json(x);
    return text + "]";
}

// Return the content of a noise file of a skin, in the form of which the checksum is computed: names in order.
inline std::string noise_text(const Skin& skin) {
    const Calibration& c = skin.geometry.calibration;
    std::string text = "null";
    if (skin.noise()) {
        const Noise& noise = *skin.noise();
        text = "{\"below_clip\":" + as_json(noise.below_clip) + ",\"clip\":" + as_json(noise.clip) +
               ",\"common\":" + as_json(noise.common) + ",\"dead\":[";
        for (std::size_t i = 0; i < noise.dead.size(); ++i)
            text += std::string(i > 0 ? "," : "") + (noise.dead[i] ? "true" : "false");
        text += "],\"detection_limits\":" + as_json(noise.detection_limits) +
                ",\"frame_repeats\":" + as_json(noise.frame_repeats) + ",\"free\":" + as_json(noise.free) +
                ",\"free_sum\":" + as_json(noise.free_sum) + ",\"lasting\":" + as_json(noise.lasting) +
                ",\"load_level\":" + as_json(noise.load_level) + ",\"load_limit\":" + as_json(noise.load_limit) +
                ",\"lowest\":" + as_json(noise.lowest) + ",\"mean\":" + as_json(noise.mean) +
                ",\"pair\":" + as_json(noise.pair) + ",\"possible\":" + as_json(noise.possible) +
                ",\"rectified\":" + as_json(noise.rectified) + ",\"release\":" + as_json(noise.release) +
                ",\"repeats\":" + as_json(noise.repeats) + ",\"sigma\":" + as_json(noise.sigma) +
                ",\"sign\":" + as_json(skin.responses.sign) + ",\"slopes\":" + as_json(noise.slopes) +
                ",\"sure\":" + as_json(noise.sure) + "}";
    }
    return "{\"baseline\":" + as_json(skin.baseline()) + ",\"calibration\":" + Json(c.checksum).dump() +
           ",\"format\":\"skin-noise\",\"link\":" + Json(c.link).dump() + ",\"noise\":" + text + ",\"version\":1}";
}

} // namespace reading

// Read the bytes of a calibration file.
inline Status read_calibration(std::string_view bytes, Calibration& calibration) noexcept {
    return reading::caught([&] {
        Calibration c = reading::calibration_of(reading::parsed(bytes));
        Status status = check(c);
        if (status.ok) calibration = std::move(c);
        return status;
    });
}

// Read the bytes of a noise file of this calibration.
inline Status read_noise(std::string_view bytes, const Calibration& calibration, Noise& noise) noexcept {
    return reading::caught([&] {
        Noise read = reading::noise_of(reading::parsed(bytes), calibration);
        Status status = check(read, calibration.ids.size());
        if (status.ok) noise = std::move(read);
        return status;
    });
}

// Read a calibration file.
inline Status load_calibration(const std::string& path, Calibration& calibration) noexcept {
    return reading::caught([&] { return read_calibration(reading::contents(path), calibration); });
}

// Read the noise file of a calibration.
inline Status load_noise(const std::string& path, const Calibration& calibration, Noise& noise) noexcept {
    return reading::caught([&] { return read_noise(reading::contents(path), calibration, noise); });
}

// Write what a skin learned at rest to a noise file, in one step. Python reads it, too.
inline Status save_noise(const std::string& path, const Skin& skin) noexcept {
    return reading::caught([&] {
        std::string text = reading::noise_text(skin);
        const std::string checksum = sha256(text), part = path + ".part";
        text.insert(text.size() - 1, ",\"checksum\":\"sha256:" + checksum + "\"");
        std::ofstream file(part, std::ios::binary);
        file << text << '\n';
        file.close();
        if (!file || std::rename(part.c_str(), path.c_str()) != 0)
            return Status::error("cannot write '" + path.substr(0, 200) + "'");
        return Status{};
    });
}

// Read a calibration file, and a noise file if its path is not empty, and start the skin. The message of a status that
// is ok names the modalities that are not computed; it is empty without any.
inline Status load(const std::string& path, const std::string& noise_path, const Options& options,
                   Skin& skin) noexcept {
    return reading::caught([&] {
        Calibration calibration;
        Noise noise;
        Status status = load_calibration(path, calibration);
        if (status.ok && !noise_path.empty()) status = load_noise(noise_path, calibration, noise);
        if (status.ok) status = skin.start(calibration, options, noise_path.empty() ? nullptr : &noise);
        if (!status.ok || calibration.modalities.empty()) return status;
        status.message = "not computed here, use Python for the modalities:";
        for (const std::string& name : calibration.modalities) status.message += " " + name;
        return status;
    });
}

} // namespace skin_calib
