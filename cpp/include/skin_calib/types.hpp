// What goes into the runtime: calibration, noise, planes and poses. SI units, frames of the links.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#ifdef __FAST_MATH__
#error "skin_calib needs NaN and infinity: compile without -ffast-math"
#endif

namespace skin_calib {

using Vec2 = std::array<double, 2>;
using Vec3 = std::array<double, 3>;
using Vec6 = std::array<double, 6>;
using Axes = std::array<Vec3, 3>;                  // rows x, y, z
using Pose = std::array<std::array<double, 4>, 4>; // T_world_link, row by row
using Numbers = std::vector<double>;
using Rows = std::vector<std::int32_t>;
using Booleans = std::vector<std::uint8_t>; // 0 or 1 for each taxel

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

// Whether something worked; otherwise a sentence that says what is wrong, and where. `load` also says what it leaves
// out.
struct [[nodiscard]] Status {
    bool ok = true;
    std::string message;

    static Status error(std::string message) { return {false, std::move(message)}; }
};

inline double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline Vec3 plus(const Vec3& a, const Vec3& b, double factor = 1.0) {
    return {a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]};
}

// Scale a vector to unit length; a zero vector stays zero.
inline Vec3 unit(const Vec3& v) {
    const double length = std::sqrt(dot(v, v));
    return length > 0 ? Vec3{v[0] / length, v[1] / length, v[2] / length} : v;
}

template <class Values> bool all_finite(const Values& values) {
    return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

// A plane in the frame of a link or of the world; its z axis points out of the ground, into the robot.
struct Plane {
    Vec3 origin{};
    Axes axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

    // Return the plane through a point [m] with a normal and an x axis along `forward`; nothing if these are parallel.
    static std::optional<Plane> through(const Vec3& point, const Vec3& up, const Vec3& forward = {1, 0, 0}) {
        const Vec3 z = unit(up), x = unit(plus(forward, z, -dot(forward, z)));
        if (!(std::abs(dot(z, z) - 1) < 1e-5 && std::abs(dot(x, x) - 1) < 1e-5)) return std::nullopt;
        return Plane{plus({0, 0, 0}, z, dot(point, z)), {x, cross(z, x), z}};
    }

    // Return the coordinates in the plane of the projection of a point.
    Vec2 flat(const Vec3& point) const {
        const Vec3 arm = plus(point, origin, -1);
        return {dot(arm, axes[0]), dot(arm, axes[1])};
    }

    // Return the height of a point over the plane [m].
    double height(const Vec3& point) const { return dot(plus(point, origin, -1), axes[2]); }

    // Return the point of the plane that has these coordinates in it.
    Vec3 spatial(const Vec2& point) const { return plus(plus(origin, axes[0], point[0]), axes[1], point[1]); }

    // Return the components of a vector along the axes.
    Vec3 along(const Vec3& v) const { return {dot(axes[0], v), dot(axes[1], v), dot(axes[2], v)}; }

    // Return a vector with these components along the axes.
    Vec3 back(const Vec3& v) const { return plus(plus(plus({0, 0, 0}, axes[0], v[0]), axes[1], v[1]), axes[2], v[2]); }

    // Return a wrench about the origin of the plane, along its axes.
    Vec6 wrench(const Vec6& w) const {
        const Vec3 force{w[0], w[1], w[2]};
        const Vec3 f = along(force), m = along(plus({w[3], w[4], w[5]}, cross(origin, force), -1));
        return {f[0], f[1], f[2], m[0], m[1], m[2]};
    }
};

// Force of a reading: a polynomial with the lowest power first, or a table. Readings outside of a range are clamped.
struct Response {
    Numbers coefficients{0.0, 1.0};
    std::optional<Vec2> range;
    Numbers readings, forces; // of a table; otherwise empty

    bool is_table() const { return !readings.empty(); }

    // Return the reading of the smallest force in the range; 0 without a range.
    double rest() const { return has_range() ? ends()[falls()] : 0.0; }

    // Return the saturation reading, which has the largest force of the range; infinite without one.
    double full() const { return has_range() ? ends()[!falls()] : infinity; }

private:
    bool has_range() const { return is_table() || range; }

    Vec2 ends() const { return is_table() ? Vec2{readings.front(), readings.back()} : *range; }

    bool falls() const {
        if (is_table()) return forces.back() < forces.front();
        const auto value = [this](double x) {
            double sum = 0.0;
            for (std::size_t k = coefficients.size(); k-- > 0;) sum = sum * x + coefficients[k];
            return sum;
        };
        return value((*range)[1]) < value((*range)[0]);
    }
};

// The taxels of one link; element i of every array is the same taxel. Link frame and SI units.
struct Calibration {
    std::string link, checksum;
    std::vector<std::string> ids;
    std::vector<std::int64_t> channels;             // position in a reading
    std::vector<Vec3> positions, normals;           // [m]; unit, out of the robot
    std::vector<Vec3> tangents, sigma;              // of messages only: unit, along the row; [m], [m], [rad], or NaN
    Numbers areas;                                  // of the cells [m^2]
    std::vector<std::vector<Vec3>> corners;         // of the cells [m]
    std::vector<std::array<std::int32_t, 2>> pairs; // rows of neighbours, the lower row first
    std::vector<Response> responses;
    Rows response;                       // index of the response of each taxel
    std::vector<std::string> modalities; // names of quantities that are not computed here
    double max_load = infinity;          // largest plausible force on all of them [N]
};

// What `tare` learnt: baseline, noise of each taxel at rest, and the levels of signed readings that follow from it.
// The names are those of skin_calib_addon/runtime/noise.py, which explains how they are learnt.
struct Noise {
    Numbers baseline;      // (n,) added to each reading, so that the reading at rest gives no force
    bool is_known = false; // otherwise the file has a baseline only
    Numbers mean, sigma, sure, lasting, pair, possible, release, lowest, repeats, slopes, free, rectified, clip,
        below_clip, detection_limits;
    Booleans dead;
    double frame_repeats = infinity, free_sum = 0, load_level = 0, common = 1, load_limit = 0;
};

// How a skin is used; the defaults are those of Python.
struct Options {
    std::optional<double> switch_on, switch_off; // [N] forces at which a taxel becomes active, and stays it
    std::optional<Plane> ground;                 // default: the plane through a flat skin
    bool in_cell = false;                        // whether sums count the pressure gradient within the cells, too
    bool follow_drift = true;                    // whether the baseline of free taxels follows their mean
    std::optional<Vec2> creep;                   // relative rise of a reading under a constant load, time constant [s]
};

inline constexpr double max_link_distance = 21.0; // [m] of a point from its link. Larger: lengths in millimetres pass
inline constexpr double max_area = 1.0;           // [m^2] of a cell
inline constexpr double single_rounding = 1e-6;   // of the length of a normal

// Return what is wrong with a ground.
inline Status check(const Plane& plane) {
    for (const Vec3& axis : plane.axes)
        if (!(std::abs(dot(axis, axis) - 1) < 1e-3))
            return Status::error("the axes of the ground must have unit length");
    if (!(dot(plane.origin, plane.origin) < 1e6)) return Status::error("the origin of the ground must be within 1 km");
    return {};
}

// Return what is wrong with a calibration: sizes, numbers that are not finite, units, rows and channels.
inline Status check(const Calibration& c) {
    const std::size_t n = c.ids.size();
    const auto at = [&](const char* what, std::size_t i) {
        return Status::error("taxel " + std::to_string(i) + " ('" + c.ids[i].substr(0, 80) + "'): " + what);
    };
    if (n == 0 || n > 1000000) return Status::error("a skin must have 1 to 1000000 taxels, not " + std::to_string(n));
    if (!(c.max_load > 0)) return Status::error("the largest load must be positive");
    if (c.channels.size() != n || c.positions.size() != n || c.normals.size() != n || c.areas.size() != n ||
        c.corners.size() != n || c.response.size() != n)
        return Status::error("the arrays of the taxels have different lengths");
    for (std::size_t i = 0; i < n; ++i) {
        if (c.channels[i] < 0 || c.channels[i] > 2147483647) return at("its channel is not in 0 to 2147483647", i);
        const auto is_near = [](const Vec3& p) { return all_finite(p) && std::sqrt(dot(p, p)) <= max_link_distance; };
        if (!is_near(c.positions[i]) || !std::all_of(c.corners[i].begin(), c.corners[i].end(), is_near))
            return at("its position is too far from the link frame; lengths are in m", i);
        if (!(std::abs(std::sqrt(dot(c.normals[i], c.normals[i])) - 1) <= single_rounding))
            return at("its normal is not a unit vector", i);
        if (!(c.areas[i] > 0 && c.areas[i] <= max_area)) return at("its area is not in 0 to 1 m^2", i);
        if (c.corners[i].size() < 3 || c.corners[i].size() > 256) return at("its cell must have 3 to 256 corners", i);
        if (c.response[i] < 0 || static_cast<std::size_t>(c.response[i]) >= c.responses.size())
            return at("its response is not in the list of responses", i);
    }
    auto channels = c.channels;
    std::sort(channels.begin(), channels.end());
    if (std::adjacent_find(channels.begin(), channels.end()) != channels.end())
        return Status::error("two taxels have the same channel");
    for (std::size_t k = 0; k < c.pairs.size(); ++k) {
        const auto [i, j] = c.pairs[k];
        if (i < 0 || j <= i || static_cast<std::size_t>(j) >= n || (k > 0 && !(c.pairs[k - 1] < c.pairs[k])))
            return Status::error("pair " + std::to_string(k) +
                                 " must be two rows in ascending order, after the last one");
    }
    for (std::size_t k = 0; k < c.responses.size(); ++k) {
        const Response& r = c.responses[k];
        const auto wrong = [&](const char* what) {
            return Status::error("response " + std::to_string(k) + ": " + what);
        };
        if (!all_finite(r.coefficients) || !all_finite(r.readings) || !all_finite(r.forces))
            return wrong("a number is not finite");
        if (!r.is_table() && (r.coefficients.empty() || r.coefficients.size() > 16))
            return wrong("a polynomial has 1 to 16 coefficients");
        if (!r.is_table() && r.range &&
            !((*r.range)[0] < (*r.range)[1] && std::isfinite((*r.range)[1] - (*r.range)[0])))
            return wrong("its range must be two finite readings, the lower one first");
        if (r.is_table() && (r.readings.size() < 2 || r.readings.size() != r.forces.size()))
            return wrong("a table has two rows at least, and a force for each reading");
        for (std::size_t i = 1; i < r.readings.size(); ++i) {
            const double rise = r.forces.back() - r.forces.front(), step = r.forces[i] - r.forces[i - 1];
            if (!(r.readings[i - 1] < r.readings[i])) return wrong("readings of a table must increase");
            if (!(rise > 0 ? step >= 0 : rise < 0 ? step <= 0 : step == 0))
                return wrong("forces of a table must only increase or only decrease");
        }
        if (r.is_table() && !std::isfinite(r.readings.back() - r.readings.front())) return wrong("its range overflows");
    }
    return {};
}

// Return what is wrong with the noise of a skin with n taxels.
inline Status check(const Noise& noise, std::size_t n) {
    if (noise.baseline.size() != n || !all_finite(noise.baseline))
        return Status::error("the baseline must have a finite number for each of " + std::to_string(n) + " taxels");
    if (!noise.is_known) return {};
    const std::pair<const char*, const Numbers*> arrays[] = {{"mean", &noise.mean},
                                                             {"sigma", &noise.sigma},
                                                             {"sure", &noise.sure},
                                                             {"lasting", &noise.lasting},
                                                             {"pair", &noise.pair},
                                                             {"possible", &noise.possible},
                                                             {"release", &noise.release},
                                                             {"lowest", &noise.lowest},
                                                             {"repeats", &noise.repeats},
                                                             {"slopes", &noise.slopes},
                                                             {"free", &noise.free},
                                                             {"rectified", &noise.rectified},
                                                             {"clip", &noise.clip},
                                                             {"below_clip", &noise.below_clip},
                                                             {"detection_limits", &noise.detection_limits}};
    for (const auto& [name, values] : arrays) {
        if (values->size() != n)
            return Status::error(std::string(name) + " has " + std::to_string(values->size()) + " numbers for " +
                                 std::to_string(n) + " taxels");
        const double allowed = values == &noise.clip ? -infinity : values == &noise.repeats ? infinity : 0.0;
        for (double x : *values)
            if (!std::isfinite(x) && x != allowed && values != &noise.detection_limits)
                return Status::error(std::string(name) + " has a number that is not finite");
    }
    if (noise.dead.size() != n) return Status::error("dead must have a value for each taxel");
    if (!all_finite(std::array{noise.free_sum, noise.load_level, noise.common, noise.load_limit}) || noise.common < 1)
        return Status::error("free_sum, load_level, common and load_limit must be finite, and common at least 1");
    if (!(noise.frame_repeats > 0) ||
        !std::all_of(noise.repeats.begin(), noise.repeats.end(), [](double x) { return x > 0; }))
        return Status::error("repeats and frame_repeats must be positive");
    for (std::size_t i = 0; i < n; ++i)
        if (!(noise.sigma[i] > 0)) return Status::error("sigma must be positive for every taxel");
    return {};
}

} // namespace skin_calib
