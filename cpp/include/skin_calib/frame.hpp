// The results of one reading: contacts, wrench, CoP, ZMP and supporting polygons. See runtime/frame.py.
#pragma once

#include "clock.hpp"
#include "contacts.hpp"
#include "touched.hpp"
#include "trusted.hpp"

namespace skin_calib {

inline constexpr double min_load = 5.0;                         // [N] load below which there is no CoP without noise
inline constexpr double outer_probability = 0.9993128620620841; // that outer contains a cell at its detection limit
inline constexpr double guaranteed_probability = 0.9997;        // that each cell of guaranteed is touched

// Three supporting polygons in the coordinates of the ground. They differ because the cells are large.
struct SupportingPolygon {
    Polygon outer;      // hull of the corners of the cells that are possibly touched
    Polygon nominal;    // hull of the centres of the active cells
    Polygon guaranteed; // hull of the centres of the cells that are surely touched, each edge moved in by a cell
    std::optional<double> outer_probability, guaranteed_probability; // of one frame; nothing without noise
};

// Why a frame has no CoP.
enum class Reason { none, not_known, lost, no_ground, low_load, no_load };

// Return a reason as a sentence.
inline const char* text(Reason reason) noexcept {
    switch (reason) {
    case Reason::none: return "there is a CoP";
    case Reason::not_known: return "no taxel has a valid reading";
    case Reason::lost: return "taxels without a valid reading may carry much of the load, or have had none yet";
    case Reason::no_ground: return "the skin is not flat and has no ground; pass one in the options";
    case Reason::low_load: return "the load is below the 5 N that a CoP needs";
    case Reason::no_load: return "no load differs from the noise";
    }
    return "";
}

// The state of one skin at one time.
struct Frame {
    double time = 0;       // [s]
    Flags flags = 0;       // bits: see `flag`
    bool is_known = false; // whether a taxel has a valid force; otherwise nothing in the frame is known
    Numbers forces;        // (n,) on each taxel [N]; 0 if it is unknown
    Booleans known;        // (n,) whether the taxel has a valid force
    Booleans saturated;    // (n,) whether the force may be larger
    Booleans stuck;        // (n,) whether the reading has not changed for too long
    Numbers lost;          // (n,) what a taxel without a valid force may carry [N]; it is in the deviations
    bool is_lost = false;  // whether that is so much that wrench and points are not known
    Touched sets;          // which taxels are touched, surely and possibly, and their weights in the sums
    Rows rows;             // (a,) active taxels, sorted by contact
    std::vector<Contact> contacts;
    Vec6 wrench{};                    // about the origin of the link [N, N m]; NaN if it is unknown or much is lost
    std::optional<Vec6> wrench_sigma; // standard deviations; all deviations are missing if the noise is unknown
    Numbers force_sigmas;             // (n,) [N]; infinite where it is unknown; empty if the noise is unknown
    double load = 0;                  // vertical force of the ground [N]
    std::optional<double> load_sigma;
    Reason reason = Reason::not_known; // why there is no CoP
    std::optional<Vec2> cop, zmp;      // in the coordinates of the ground [m]
    std::optional<Vec2> cop_sigma, zmp_sigma;
    SupportingPolygon polygon; // empty without a ground

    bool has(Flags flag) const noexcept { return (flags & flag) != 0; }

    // Return whether there is a contact or a load; nothing if that is unknown, which is not the same as no contact.
    std::optional<bool> touched() const noexcept {
        if (is_known && (!contacts.empty() || sets.stands.value_or(false))) return true;
        return is_known && !is_lost ? std::optional<bool>(false) : std::nullopt;
    }

    // Return which statements of the frame hold, and which flags take the others away.
    Trusted trusted() const noexcept { return trusted_of(flags, touched()); }

    // Return whether the link stands on its ground: it has a load that is not noise.
    bool stands() const noexcept { return reason == Reason::none; }
};

} // namespace skin_calib
