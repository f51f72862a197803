/* Photo points on a mesh of nodes in space, and how they move on it with the nodes: services/sheet/ridged. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>

enum { POINTS = 64, CORNERS = 4 }; /* of a block, whose arrays stay in the first cache; of a cell */

/* `nodes` (rows, columns, 3), seen with this focal length. */
struct mesh {
    const double *nodes;
    ptrdiff_t rows, columns;
    double focal;
};

/* Newton's method: at most so many `steps`, of at most `longest` cells; a point is `found` within this distance in the
   photo. Those that are not go on alone where they are less than the share `most`. Grid coordinates lie within `reach`
   of the mesh; points that end farther away than `located` have none. */
struct search {
    int32_t steps;
    double longest, found, most, reach, located;
};

/* Points of the mesh: number of the cell's first node, place in the cell, point in space, derivatives by column and
   row. */
struct placed {
    ptrdiff_t first[POINTS];
    double s[POINTS], t[POINTS], X[3][POINTS], by_column[3][POINTS], by_row[3][POINTS];
};

static inline double cell_of(double at, ptrdiff_t nodes) {
    const double cell = floor(at), last = (double)(nodes - 2);
    return cell > 0 ? (cell < last ? cell : last) : 0;
}

/* Bilinear within cells; those of the border are continued. */
AVX2 static void place_points(
    const struct mesh *mesh, const double *restrict column, const double *restrict row, int count,
    struct placed *restrict placed) {
    for (int i = 0; i < count; i++) {
        const double c = cell_of(column[i], mesh->columns), r = cell_of(row[i], mesh->rows);
        placed->s[i] = column[i] - c;
        placed->t[i] = row[i] - r;
        placed->first[i] = (ptrdiff_t)(int32_t)r * mesh->columns + (int32_t)c;
    }
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < count; i++) {
            const double *corner = mesh->nodes + 3 * placed->first[i] + k, *below = corner + 3 * mesh->columns;
            const double across = corner[3] - corner[0], down = below[0] - corner[0];
            const double twist = below[3] - corner[0] - across - down;
            placed->by_column[k][i] = across + placed->t[i] * twist;
            placed->by_row[k][i] = down + placed->s[i] * twist;
            placed->X[k][i] = corner[0] + placed->s[i] * placed->by_column[k][i] + placed->t[i] * down;
        }
}

/* G (2, 2) = d photo / d grid. */
static inline void derive(const struct mesh *mesh, const struct placed *placed, int i, double G[2][2]) {
    for (int axis = 0; axis < 2; axis++) {
        const double depth = placed->X[2][i], seen = mesh->focal * placed->X[axis][i] / depth;
        G[axis][0] = (mesh->focal * placed->by_column[axis][i] - seen * placed->by_column[2][i]) / depth;
        G[axis][1] = (mesh->focal * placed->by_row[axis][i] - seen * placed->by_row[2][i]) / depth;
    }
}

static inline double between(double value, double least, double most) {
    return value < least ? least : value > most ? most : value;
}

/* Distances in the photo from where the grid's points are seen, and Newton's steps from there, of `count` points. */
AVX2 static void take_steps(
    const struct mesh *mesh, const struct search *search, const double *photo, const double *grid,
    const ptrdiff_t *sought, int count, double *restrict miss, double *restrict steps) {
    double x[POINTS], y[POINTS], column[POINTS] = {0}, row[POINTS] = {0};
    struct placed placed;
    for (int i = 0; i < count; i++) {
        x[i] = photo[2 * sought[i]];
        y[i] = photo[2 * sought[i] + 1];
        column[i] = grid[2 * sought[i]];
        row[i] = grid[2 * sought[i] + 1];
    }
    place_points(mesh, column, row, count, &placed);
    for (int i = 0; i < count; i++) {
        const double depth = placed.X[2][i], ahead = depth <= 1e-6 ? NAN : depth;
        const double rest[2] = {x[i] - mesh->focal * placed.X[0][i] / ahead, y[i] - mesh->focal * placed.X[1][i] / ahead};
        double G[2][2];
        derive(mesh, &placed, i, G);
        double det = G[0][0] * G[1][1] - G[0][1] * G[1][0];
        det = fabs(det) < 1e-12 ? 1e-12 : det;
        const double a = (G[1][1] * rest[0] - G[0][1] * rest[1]) / det;
        const double b = (G[0][0] * rest[1] - G[1][0] * rest[0]) / det;
        const double length = sqrt(a * a + b * b), share = search->longest / (length < 1e-12 ? 1e-12 : length);
        const double part = share > 1 ? 1 : share;
        miss[i] = sqrt(rest[0] * rest[0] + rest[1] * rest[1]);
        steps[2 * i] = a * part == a * part ? a * part : 0;
        steps[2 * i + 1] = b * part == b * part ? b * part : 0;
    }
}

/* Grid coordinates `grid` (count, 2) of `photo` points (count, 2), from the ones that it holds. Returns 0 where memory is
   missing. */
int locate_points(
    const struct mesh *mesh, const struct search *search, const double *photo, ptrdiff_t count, double *grid) {
    ptrdiff_t *sought = malloc((count + 1) * sizeof *sought);
    double *miss = malloc((count + 1) * sizeof *miss), *steps = malloc((2 * count + 1) * sizeof *steps);
    const int good = sought && miss && steps;
    const double least = -search->reach, last[2] = {mesh->columns - 1 + search->reach, mesh->rows - 1 + search->reach};
    ptrdiff_t going = good ? count : 0;
    for (ptrdiff_t i = 0; i < going; i++) sought[i] = i;
    for (int number = 0; going; number++) {
        ptrdiff_t far = 0, kept = 0;
        for (ptrdiff_t begin = 0; begin < going; begin += POINTS) {
            const int some = going - begin < POINTS ? (int)(going - begin) : POINTS;
            double distances[POINTS];
            take_steps(mesh, search, photo, grid, sought + begin, some, distances, steps + 2 * begin);
            for (int i = 0; i < some; i++) {
                miss[sought[begin + i]] = distances[i];
                far += !(distances[i] < search->found);
            }
        }
        if (number == search->steps || !far) break;
        const int alone = far < search->most * going;
        for (ptrdiff_t i = 0; i < going; i++) {
            const ptrdiff_t at = sought[i];
            if (alone && miss[at] < search->found) continue;
            for (int axis = 0; axis < 2; axis++)
                grid[2 * at + axis] = between(grid[2 * at + axis] + steps[2 * i + axis], least, last[axis]);
            sought[kept++] = at;
        }
        going = kept;
    }
    for (ptrdiff_t i = 0; good && i < count; i++)
        if (!(miss[i] < search->located)) grid[2 * i] = grid[2 * i + 1] = NAN;
    free(sought);
    free(miss);
    free(steps);
    return good;
}

/* Derivatives of the grid coordinates (count, 2) at which `photo` points are seen by the cell's nodes (4, 3), and by the
   logarithm of the focal length, number `focal_at` of the unknowns: their `columns` (count, 13), those of the grid's
   columns and of its rows `entries` (2, count, 13). If the nodes move by dX_k, dg = -G^-1 sum_k w_k P dX_k with
   P = (f I | -x) / Z; if f changes, -G^-1 x d(log f). Points that are not `known` have none. */
AVX2 void derive_points(
    const struct mesh *mesh, const double *photo, const double *grid, const uint8_t *known, ptrdiff_t count,
    ptrdiff_t focal_at, ptrdiff_t *columns, double *entries) {
    enum { WIDTH = 3 * CORNERS + 1 };
    for (ptrdiff_t begin = 0; begin < count; begin += POINTS) {
        const int some = count - begin < POINTS ? (int)(count - begin) : POINTS;
        double column[POINTS] = {0}, row[POINTS] = {0};
        struct placed placed;
        for (int i = 0; i < some; i++) {
            column[i] = grid[2 * (begin + i)];
            row[i] = grid[2 * (begin + i) + 1];
        }
        place_points(mesh, column, row, some, &placed);
        for (int i = 0; i < some; i++) {
            const ptrdiff_t at = begin + i, nodes[CORNERS] = {0, 1, mesh->columns, mesh->columns + 1};
            const double s = placed.s[i], t = placed.t[i], depth = placed.X[2][i];
            const double x = photo[2 * at], y = photo[2 * at + 1];
            const double weights[CORNERS] = {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
            double G[2][2];
            derive(mesh, &placed, i, G);
            double det = G[0][0] * G[1][1] - G[0][1] * G[1][0];
            det = fabs(det) < 1e-9 ? (det < 0 ? -1e-9 : 1e-9) : det;
            const double inverse[2][2] = {{G[1][1] / det, -G[0][1] / det}, {-G[1][0] / det, G[0][0] / det}};
            for (int axis = 0; axis < 2; axis++) {
                const double a = known[at] ? -inverse[axis][0] : 0, b = known[at] ? -inverse[axis][1] : 0;
                const double by_point[3] = {
                    a * (mesh->focal / depth), b * (mesh->focal / depth), a * (-x / depth) + b * (-y / depth)};
                double *own = entries + (axis * count + at) * WIDTH;
                for (int corner = 0; corner < CORNERS; corner++)
                    for (int k = 0; k < 3; k++) own[3 * corner + k] = weights[corner] * by_point[k];
                own[WIDTH - 1] = a * x + b * y;
            }
            for (int corner = 0; corner < CORNERS; corner++)
                for (int k = 0; k < 3; k++)
                    columns[at * WIDTH + 3 * corner + k] = 3 * (placed.first[i] + nodes[corner]) + k;
            columns[at * WIDTH + WIDTH - 1] = focal_at;
        }
    }
}
