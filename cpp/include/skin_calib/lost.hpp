// What taxels without a valid reading may carry: what they carried last, or what their neighbours do. See
// runtime/lost.py.
#pragma once

#include "geometry.hpp"

namespace skin_calib {

// Remember the last force of each taxel, and bound the forces that are not known.
class Lost {
public:
    Numbers bounds; // (n,) what a taxel without a valid force may carry [N]; 0 where it is known

    void start(const SkinGeometry& skin) {
        skin_ = &skin;
        for (auto* list : {&bounds, &values_, &found_}) list->assign(skin.n, 0.0);
        last_.assign(skin.n, not_a_number);
        round_.assign(skin.n, 0);
    }

    void forget() noexcept { std::fill(last_.begin(), last_.end(), not_a_number); }

    // Store the parts of the sums (n,) [N] of the taxels that are known (n,).
    void accept(const Numbers& pushes, const Booleans& known) noexcept {
        for (std::size_t i = 0; i < skin_->n; ++i)
            if (known[i]) last_[i] = pushes[i];
    }

    // Compute the bounds; return whether they are so large that wrench and points say nothing.
    //   pushes, known, live: (n,) parts of the sums [N]; whether the force is valid; whether neither masked nor dead
    template <class Live> bool look(const Numbers& pushes, const Booleans& known, const Live& is_live) noexcept {
        fill(pushes, known);
        double lost = 0, rest = 0;
        bool is_unseen = false;
        for (std::size_t i = 0; i < skin_->n; ++i) {
            rest += pushes[i];
            bounds[i] = 0.0;
            if (known[i]) continue;
            const bool is_missing = is_live(i), has_last = !std::isnan(last_[i]);
            bounds[i] = std::max(values_[i], is_missing && has_last ? last_[i] : 0.0);
            lost += bounds[i];
            is_unseen = is_unseen || (is_missing && !has_last);
        }
        rest = std::max(rest, 0.0);
        return lost > max_lost_fraction * rest || (rest == 0 && is_unseen);
    }

    void clear() noexcept { std::fill(bounds.begin(), bounds.end(), 0.0); }

private:
    static constexpr double max_lost_fraction = 0.5; // [1] of what all others carry: see runtime/lost.py

    // Set the values (n,) of unknown taxels to the mean of their neighbours, from the border inwards; where no
    // neighbour leads, to the mean of all known ones.
    void fill(const Numbers& pushes, const Booleans& known) noexcept {
        const std::size_t n = skin_->n;
        double sum = 0;
        std::size_t count = 0;
        for (std::size_t i = 0; i < n; ++i) {
            round_[i] = known[i] ? 1 : 0;
            if (known[i]) values_[i] = pushes[i], sum += pushes[i], ++count;
        }
        for (std::size_t i = 0; i < n; ++i)
            if (!known[i]) values_[i] = sum / static_cast<double>(std::max<std::size_t>(count, 1));
        for (std::int32_t round = 1;; ++round) {
            bool any = false;
            for (std::size_t i = 0; i < n; ++i) {
                if (round_[i] != 0) continue;
                double around = 0;
                std::size_t near = 0;
                for (std::size_t k = skin_->begin(i); k < skin_->end(i); ++k) {
                    const std::size_t j = skin_->neighbour(k);
                    if (round_[j] != 0 && round_[j] <= round) around += values_[j], ++near;
                }
                if (near == 0) continue;
                found_[i] = around / static_cast<double>(near), round_[i] = round + 1, any = true;
            }
            if (!any) return;
            for (std::size_t i = 0; i < n; ++i)
                if (round_[i] == round + 1) values_[i] = found_[i];
        }
    }

    const SkinGeometry* skin_ = nullptr;
    Numbers last_, values_, found_;
    Rows round_; // (n,) in which a value was found; 0: not yet
};

} // namespace skin_calib
