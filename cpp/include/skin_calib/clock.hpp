// The times of the frames, and the creep of soft sensors over time. See runtime/clock.py and creep.py.
#pragma once

#include "types.hpp"

namespace skin_calib {

// Problems of a frame, as bits of `Frame::flags`; the names are those of Python.
using Flags = std::uint32_t;
namespace flag {
inline constexpr Flags wrong_length = 1u << 0;  // the reading is missing, or too short for the highest channel
inline constexpr Flags not_finite = 1u << 1;    // some taxels sent NaN or infinity
inline constexpr Flags too_large = 1u << 2;     // some forces are impossible
inline constexpr Flags blind = 1u << 3;         // no taxel has a valid force
inline constexpr Flags saturated = 1u << 4;     // some forces may be larger
inline constexpr Flags noise_unknown = 1u << 5; // nothing is guaranteed
inline constexpr Flags dead = 1u << 6;          // some taxels did not change at rest
inline constexpr Flags time_not_finite = 1u << 7;
inline constexpr Flags time_still = 1u << 8;    // equal to the last time
inline constexpr Flags time_back = 1u << 9;     // before the last time
inline constexpr Flags time_jump = 1u << 10;    // the contacts before say nothing about this frame
inline constexpr Flags dropped = 1u << 11;      // frames between the last one and this one are missing
inline constexpr Flags no_reading = 1u << 12;   // of a body: this link has no reading
inline constexpr Flags no_pose = 1u << 13;      // of a body: this link has no finite pose
inline constexpr Flags wrong_pose = 1u << 14;   // of a body: the pose of this link is no rigid motion
inline constexpr Flags not_coplanar = 1u << 15; // of a body: feet stand at different heights, or tilted
inline constexpr Flags lost = 1u << 16;         // taxels without a valid reading may carry much of the load
inline constexpr Flags overload = 1u << 17;     // the force is larger than is plausible: nothing is guaranteed
inline constexpr Flags drift = 1u << 18;        // readings without contact have moved: nothing is guaranteed
inline constexpr Flags noisy = 1u << 19;        // the noise of some taxels has grown
inline constexpr Flags stuck = 1u << 20;        // some readings have not changed for too long
inline constexpr Flags frozen = 1u << 21;       // no reading has changed for too long
inline constexpr Flags below_rest = 1u << 22;   // some readings are below those without contact
inline constexpr Flags byte_order = 1u << 23;   // the two bytes of the readings are swapped
inline constexpr Flags rest_assumed = 1u << 24; // nothing is guaranteed before the skin was lifted
inline constexpr const char* names[] = {
    "wrong_length",    "not_finite",   "too_large",  "blind",       "saturated", "noise_unknown", "dead",
    "time_not_finite", "time_still",   "time_back",  "time_jump",   "dropped",   "no_reading",    "no_pose",
    "wrong_pose",      "not_coplanar", "lost",       "overload",    "drift",     "noisy",         "stuck",
    "frozen",          "below_rest",   "byte_order", "rest_assumed"}; // of the bits
} // namespace flag

// Keep the time of the last frame, that of the last one with a valid reading, and the usual period between frames.
class Clock {
public:
    // Return what is wrong with the time of a frame [s]; change nothing.
    Flags flags(double time) const noexcept {
        if (!std::isfinite(time)) return flag::time_not_finite;
        if (!last_) return 0;
        const double gap = time - *last_;
        if (gap == 0) return last_ == valid_ ? flag::time_still : 0; // after an unusable frame, it may be sent again
        if (gap < 0) return flag::time_back;
        if (is_jump(gap)) return flag::time_jump;
        return period_ > 0 && gap > 1.75 * period_ ? flag::dropped : 0;
    }

    // Return whether the last valid reading says something about a valid one at this time [s].
    bool has_past(double time) const noexcept {
        const auto is_past = [&](const std::optional<double>& then) {
            return !then || !std::isfinite(time) || !(time - *then < 0 || is_jump(time - *then));
        };
        return !is_lost_ && is_past(last_) && is_past(valid_);
    }

    // Return the usual period [s]; 0 before the second frame, infinite after a jump.
    double period() const noexcept { return period_; }

    // Store the time of a frame [s], with or without a valid reading, and update the usual period.
    void accept(double time, bool is_valid) noexcept {
        if (!std::isfinite(time)) return;
        const double gap = last_ ? time - *last_ : 0.0;
        is_lost_ = !is_valid && (is_lost_ || gap < 0 || is_jump(gap));
        if (is_jump(gap)) {
            period_ = infinity;
        } else if (gap > 0) {
            const double period = 0 < period_ && period_ < infinity ? period_ : gap;
            period_ = period + 0.1 * (std::min(gap, 2 * period) - period);
        }
        last_ = time;
        if (is_valid) valid_ = time;
    }

private:
    bool is_jump(double gap) const noexcept { return gap > 1.0 && gap > 50.0 * period_; }

    std::optional<double> last_, valid_;
    bool is_lost_ = false;
    double period_ = 0.0; // [s] 0 before the second frame; infinite after a jump: a slow clock may follow
};

// The part of signed readings that follows the load late.
class Creep {
public:
    Numbers part; // (n,) of the signed readings

    // Set the relative rise and its time constant [s].
    void start(std::size_t n, double fraction, double time) {
        part.assign(n, 0.0);
        fraction_ = fraction, time_ = time, last_ = not_a_number;
    }

    void restart() noexcept {
        std::fill(part.begin(), part.end(), 0.0);
        last_ = not_a_number;
    }

    // Add a frame with signed readings (n,) without creep, relative to those without contact.
    void add(const Numbers& readings, double time) noexcept {
        if (!std::isfinite(time)) return;
        const double gap = time - last_;
        last_ = time;
        if (!(gap > 0)) return;
        const double gain = -std::expm1(-gap / time_);
        for (std::size_t i = 0; i < part.size(); ++i) {
            const double change = gain * (fraction_ * readings[i] - part[i]);
            if (std::isfinite(change)) part[i] += change;
        }
    }

private:
    double fraction_ = 0, time_ = 1, last_ = not_a_number;
};

} // namespace skin_calib
