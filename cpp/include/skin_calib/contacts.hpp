// Contacts: connected active taxels, with numbers that stay the same from cycle to cycle. See runtime/contacts.py,
// components.py and identity.py.
#pragma once

#include "geometry.hpp"

namespace skin_calib {

// Connected active taxels and the force on them; link frame and SI units.
struct Contact {
    std::int64_t number = 0;        // stays with the contact from cycle to cycle
    std::size_t begin = 0, end = 0; // its taxels are `Frame::rows[begin]` to `Frame::rows[end - 1]`, ascending
    double force = 0;               // sum over the taxels [N]
    Vec6 wrench{};                  // on the robot, about the origin of the link [N, N m]
    Vec3 position{};                // force-weighted mean of the taxel positions, raised to the surface [m]
    Vec3 normal{};                  // force-weighted mean of the outward normals, unit; zero if they cancel
    double area = 0;                // of the cells [m^2]
    double peak_pressure = 0;       // largest ratio of the force of a taxel to its area [Pa]
};

// Group active taxels, and keep the contacts of the last frame.
class ContactFinder {
public:
    // Allocate memory; the skin must live as long.
    void start(const SkinGeometry& skin) {
        skin_ = &skin;
        groups_.assign(skin.n, none), owner_.assign(skin.n, none);
        for (auto* list : {&last_rows_, &starts_, &taken_}) list->reserve(skin.n + 1);
        counts_.assign(skin.n, 0), numbers_.reserve(skin.n), last_numbers_.reserve(skin.n);
        overlaps_.reserve(skin.n), touched_.reserve(skin.n);
        forget();
        next_ = 1;
    }

    // Forget the contacts of the last frame. Their numbers are never used again.
    void forget() noexcept {
        for (std::int32_t row : last_rows_) owner_[static_cast<std::size_t>(row)] = none;
        last_rows_.clear(), last_numbers_.clear();
    }

    // Find the contacts of a frame.
    //   active, forces: (n,) of the frame [N]; `terms`: (n, 11) what the sums weigh with
    //   rows: becomes the active taxels, sorted by contact; contacts: in the order of their first taxels
    void find(const Booleans& active, const Numbers& forces, const std::vector<SkinGeometry::LinkTerms>& terms,
              Rows& rows, std::vector<Contact>& contacts) noexcept {
        group(active, rows);
        inherit(rows);
        contacts.clear();
        for (std::size_t g = 0; g + 1 < starts_.size(); ++g)
            contacts.push_back(contact(numbers_[g], static_cast<std::size_t>(starts_[g]),
                                       static_cast<std::size_t>(starts_[g + 1]), rows, forces, terms));
    }

private:
    static constexpr std::int32_t none = -1;

    struct Overlap {
        std::int32_t count, owner, group;
    };

    // Sort the active taxels by connected component; the components are in the order of their first taxels.
    void group(const Booleans& active, Rows& rows) noexcept {
        rows.clear(), starts_.clear();
        std::fill(groups_.begin(), groups_.end(), none);
        for (std::size_t seed = 0; seed < active.size(); ++seed) {
            if (!active[seed] || groups_[seed] != none) continue;
            const auto number = static_cast<std::int32_t>(starts_.size());
            const std::size_t start = rows.size();
            starts_.push_back(static_cast<std::int32_t>(start));
            groups_[seed] = number;
            rows.push_back(static_cast<std::int32_t>(seed));
            for (std::size_t k = start; k < rows.size(); ++k) {
                const auto i = static_cast<std::size_t>(rows[k]);
                for (std::size_t e = skin_->begin(i); e < skin_->end(i); ++e) {
                    const std::size_t j = skin_->neighbour(e);
                    if (!active[j] || groups_[j] != none) continue;
                    groups_[j] = number;
                    rows.push_back(static_cast<std::int32_t>(j));
                }
            }
            std::sort(rows.begin() + static_cast<std::ptrdiff_t>(start), rows.end());
        }
        starts_.push_back(static_cast<std::int32_t>(rows.size()));
    }

    // Give each contact the number of the one of the last frame with the most taxels in common; others get new numbers.
    void inherit(const Rows& rows) noexcept {
        const std::size_t count = starts_.size() - 1;
        numbers_.assign(count, 0);
        taken_.assign(last_numbers_.size(), 0);
        take_over(rows, [this](std::size_t i) { return owner_[i]; });
        const auto is_new = [](std::int64_t number) { return number == 0; };
        for (std::size_t k = 0; k < skin_->most_neighbours && !last_numbers_.empty(); ++k) {
            if (std::none_of(numbers_.begin(), numbers_.end(), is_new)) break;
            take_over(rows, [this, k](std::size_t i) { // a contact moves by less than a cell in a cycle
                const std::size_t e = skin_->begin(i) + k;
                return e < skin_->end(i) ? owner_[skin_->neighbour(e)] : none;
            });
        }
        for (std::int64_t& number : numbers_)
            if (number == 0) number = next_++;
        forget();
        for (std::size_t g = 0; g < count; ++g)
            for (std::int32_t k = starts_[g]; k < starts_[g + 1]; ++k)
                owner_[static_cast<std::size_t>(rows[static_cast<std::size_t>(k)])] = static_cast<std::int32_t>(g);
        last_rows_.assign(rows.begin(), rows.end());
        last_numbers_.assign(numbers_.begin(), numbers_.end());
    }

    // Give contacts without a number that of the last contact with the most owners in it; of equal ones, the lowest.
    template <class OwnerOf> void take_over(const Rows& rows, OwnerOf owner_of) noexcept {
        overlaps_.clear();
        for (std::size_t g = 0; g + 1 < starts_.size(); ++g) {
            touched_.clear();
            for (std::int32_t k = starts_[g]; k < starts_[g + 1]; ++k) {
                const std::int32_t owner = owner_of(static_cast<std::size_t>(rows[static_cast<std::size_t>(k)]));
                if (owner != none && counts_[static_cast<std::size_t>(owner)]++ == 0) touched_.push_back(owner);
            }
            for (std::int32_t owner : touched_) {
                overlaps_.push_back(
                    {std::exchange(counts_[static_cast<std::size_t>(owner)], 0), owner, static_cast<std::int32_t>(g)});
            }
        }
        std::sort(overlaps_.begin(), overlaps_.end(), [this](const Overlap& a, const Overlap& b) {
            if (a.count != b.count) return a.count > b.count;
            if (a.owner != b.owner) return number_of(a) < number_of(b);
            return a.group < b.group;
        });
        for (const Overlap& overlap : overlaps_) {
            auto& number = numbers_[static_cast<std::size_t>(overlap.group)];
            auto& is_taken = taken_[static_cast<std::size_t>(overlap.owner)];
            if (number != 0 || is_taken) continue;
            number = number_of(overlap);
            is_taken = 1;
        }
    }

    std::int64_t number_of(const Overlap& overlap) const noexcept {
        return last_numbers_[static_cast<std::size_t>(overlap.owner)];
    }

    // Sum over the taxels of one contact.
    Contact contact(std::int64_t number, std::size_t begin, std::size_t end, const Rows& rows, const Numbers& forces,
                    const std::vector<SkinGeometry::LinkTerms>& terms) const noexcept {
        constexpr double min_mean_normal = 1e-9;
        Contact result;
        result.number = number, result.begin = begin, result.end = end;
        SkinGeometry::LinkTerms sums{};
        for (std::size_t k = begin; k < end; ++k) {
            const auto i = static_cast<std::size_t>(rows[k]);
            for (std::size_t t = 0; t < sums.size(); ++t) sums[t] += forces[i] * terms[i][t];
            result.area += skin_->calibration.areas[i];
            result.peak_pressure = std::max(result.peak_pressure, forces[i] / skin_->calibration.areas[i]);
        }
        const auto [force, px, py, pz, height, fx, fy, fz, tx, ty, tz] = sums;
        result.force = force;
        result.wrench = {fx, fy, fz, tx, ty, tz};
        const Vec3 mean{px / force, py / force, pz / force}, m{-fx / force, -fy / force, -fz / force};
        const double length = std::sqrt(dot(m, m)); // 1 if all normals are parallel
        result.position = mean;
        if (length < min_mean_normal) return result;
        const double rise = (height / force - dot(m, mean)) / (1 + length) / length;
        result.position = plus(mean, m, rise);
        result.normal = {m[0] / length, m[1] / length, m[2] / length};
        return result;
    }

    const SkinGeometry* skin_ = nullptr;
    Rows groups_, owner_, last_rows_, starts_, taken_, counts_, touched_;
    std::vector<std::int64_t> numbers_, last_numbers_;
    std::vector<Overlap> overlaps_;
    std::int64_t next_ = 1;
};

} // namespace skin_calib
