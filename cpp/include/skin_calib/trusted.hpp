// Which statements of a frame hold: one rule for controllers instead of a list of flags. See runtime/trusted.py.
#pragma once

#include "clock.hpp"

namespace skin_calib {

// Which statements of a frame hold. It is true if all do.
struct Trusted {
    bool touched = false;    // whether true and false of `touched()` hold; nothing is no statement
    bool wrench = false;     // whether wrench, contacts and forces are within their deviations
    bool point = false;      // whether CoP and ZMP are within their deviations, or missing because nothing stands
    bool guaranteed = false; // whether the true contact contains the guaranteed polygon, with its probability
    Flags why = 0;           // flags that take a statement away

    explicit operator bool() const noexcept { return touched && wrench && point && guaranteed; }
};

namespace flag {
// Flags that take statements away: the polygon, and all others; touched; wrench and point. All other flags are in the
// deviations, or concern other frames.
inline constexpr Flags not_guaranteed =
    blind | byte_order | drift | frozen | noise_unknown | noisy | overload | wrong_length | rest_assumed;
inline constexpr Flags takes_touched = (not_guaranteed & ~rest_assumed) | below_rest | stuck;
inline constexpr Flags takes_sums = takes_touched | lost | saturated;
} // namespace flag

// Return what holds of a frame with these flags, and this `touched()`.
inline Trusted trusted_of(Flags flags, const std::optional<bool>& touched) noexcept {
    const bool has_sums = (flags & flag::takes_sums) == 0;
    return {touched && (flags & flag::takes_touched) == 0, has_sums, has_sums, (flags & flag::not_guaranteed) == 0,
            flags & (flag::takes_sums | flag::not_guaranteed)};
}

} // namespace skin_calib
