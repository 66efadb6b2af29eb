/* The steps of the twin: what happens to hand, object and skin in a step of the physics.
 *
 * A sample of the sensor is a few steps. In each, MuJoCo moves the bodies by half a step; hand.c
 * reads where fingertips and object are; contact.c computes the forces between skin (skin.c,
 * coupled.c) and object (shapes.c), operator.c those of a person, control.c the torques of the
 * motors; hand.c applies all of them; MuJoCo moves the bodies by the other half. physics.c does
 * what is between the halves. uskin_readout.c makes counts of the forces on the taxels.
 *
 * Structs of numbers below are rows of NumPy's arrays; module.c gives their columns to Python.
 * The caller owns all memory, and nothing is allocated. The order of every sum is part of the
 * result: recordings of one seed are the same bits, so compile with -ffp-contract=off.
 *
 * SI units; a rotation is given by its rows and leads from the frame of the body to the world's.
 */
#ifndef HOLDFAST_TWIN_STEPS_H
#define HOLDFAST_TWIN_STEPS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PI 3.14159265358979323846

typedef struct {
    double x, y, z;
} vec;

typedef struct {
    vec x, y, z; /* rows */
} mat;

/* The core of an object, which is extended on all sides by a rounding. */
enum {
    REVOLVED, /* a frustum or cylinder */
    BOX,
    HEXAGON, /* a prism */
    CAPSULE, /* a line or point */
};

/* An object. */
typedef struct {
    double code;                  /* of the core, one of the above */
    double size[3];               /* of the core; of a frustum: radii at foot and top, height [m] */
    double side_out, side_up;     /* normal of the side of a frustum: outward, upward */
    double side_length;           /* of a frustum [m] */
    double extension;             /* of the core on all sides [m] */
    double centre;                /* height of the centre of mass above the middle [m] */
    double texture_amplitude;     /* [m] */
    double wave, wave_2;          /* of the texture, along z [rad/m] */
    double around, around_2;      /* waves of the texture about the axis [1] */
    double mu_static, mu_kinetic; /* coefficients of friction */
} solid;

/* The material of a skin (the fields of `Skin`, which explains them), and a ball around it. */
typedef struct {
    double stiffness, hardening, damping, shear, engagement, shear_time, stribeck, memory, slipping;
    double shear_modulus; /* [Pa]; 0: each node is a separate spring */
    vec ball_centre;
    double ball_radius; /* of a ball that contains all nodes [m] */
} skin;

/* A node of the skin. */
typedef struct {
    vec position;       /* in the fingertip frame [m] */
    double stiffness;   /* at small depths [N/m] */
    double path_length; /* of the path from the first node to it through all between them [m] */
} node;

/* The bristle of a node: all that a contact remembers. */
typedef struct {
    vec stretch; /* along the surface, in the fingertip frame [m] */
    double slip; /* plastic slip speed, low-pass filtered [m/s] */
    /* Of a coupled node, in the fingertip frame: */
    vec force;   /* without damping [N] */
    vec moved;   /* displacement by all others [m] */
    double wake; /* `travel` of the fingertip up to which it can touch nothing [m] */
} bristle;

typedef struct {
    vec force, torque; /* [N], [N m] */
} wrench;

/* Results of a fingertip. */
typedef struct {
    wrench wrench;         /* on it, about the origin of its frame, in the world frame */
    double slip;           /* mean slip speed of the nodes, weighted by their load [m/s] */
    double slipping_share; /* of the load */
    double load;           /* sum of the normal forces [N] */
    double travel;         /* of coupled nodes: how far one may have come closer, at most [m] */
} tip;

/* Pose and motion of a fingertip frame, or of the object about its centre of mass, in the world. */
typedef struct {
    vec position;
    mat rotation;
    vec velocity; /* of the origin */
    vec spin;     /* angular velocity */
} body;

/* A pose to which a hand pulls the object. */
typedef struct {
    vec position;
    mat rotation;
} pose;

/* A hand that takes the object along. */
typedef struct {
    pose pose;
    vec velocity, spin;                  /* with which the pose moves */
    double stiffness, damping;           /* [N/m], [N s/m] */
    double turn_stiffness, turn_damping; /* [N m/rad], [N m s/rad] */
    double rms;                          /* of its tremor [m] */
} guide;

/* Numbers of a disturbance. */
typedef struct {
    vec direction;    /* unit vector */
    vec arm;          /* point of contact relative to the centre of mass [m] */
    double depth;     /* [m] */
    double stiffness; /* [N/m] */
    double rate;      /* of shaking or moving [Hz] */
} disturbance;

/* Styles of a disturbance: a finger pushes, strikes or shakes; a hand moves the object. */
enum { PUSH, JERK, SHAKE, MOVE };

typedef struct {
    double amplitude, rate, phase; /* [1], [rad/s], [rad] */
} sinusoid;

/* A tremor of rms 1: n sinusoids for each axis. */
typedef struct {
    const sinusoid *sinusoids; /* (3, n) */
    size_t n;
} tremor;

/* Skin and object in a contact. */
typedef struct {
    const node *nodes;
    const solid *solid;
    const skin *skin;
    const double *nearness; /* (n_coupled, n_coupled), see `nearness_of`; n_nodes if coupled */
    size_t n_nodes, n_coupled;
} constants;

/* State and results of a contact. */
typedef struct {
    bristle *bristles; /* (n_tips, n_nodes) */
    vec *node_forces;  /* (n_tips, n_nodes) on the nodes, in the fingertip frame [N] */
    tip *tips;         /* (n_tips) */
    wrench *wrench;    /* on the object, about its centre of mass, in the world frame */
    size_t n_tips;
} contact;

/* MuJoCo's state, and where hand and object are in it. */
typedef struct {
    const vec *xpos, *xipos;        /* (n_model) origins and centres of mass of the bodies */
    const mat *xmat, *ximat;        /* (n_model) */
    const vec (*cvel)[2];           /* (n_model) spin and velocity about the tree's centre */
    const vec *subtree_com;         /* (n_model) */
    const double *qpos, *qfrc_bias; /* joints [rad]; torques that balance gravity and motion */
    double *qfrc_applied;           /* torques of the motors [N m] */
    wrench *xfrc_applied;           /* (n_model) */
    const int *roots;               /* (n_model) root of the tree of each body */
    const int *tips;                /* (n_tips) bodies of the last links */
    const vec *mounts;              /* (n_tips) origin of each fingertip frame in its last link */
    int64_t object_body;
    size_t n_tips, n_model;
} hand;

enum { N_JOINTS = 16 };

/* Random numbers and state of the controller, see `Controller`. */
typedef struct {
    const double *gains;               /* (16) [N m/rad] */
    const double *compensation;        /* (16) */
    const double (*noise)[N_JOINTS];   /* (n_noise) */
    const double (*errors)[N_JOINTS];  /* (n_errors) */
    double *last, *published, *geared; /* (16) */
    double backlash;
    size_t n_noise, n_errors;
} controller;

static double smaller(double a, double b)
{
    return b < a ? b : a;
}

static double larger(double a, double b)
{
    return b > a ? b : a;
}

static vec add(vec a, vec b)
{
    return (vec){a.x + b.x, a.y + b.y, a.z + b.z};
}

static vec subtract(vec a, vec b)
{
    return (vec){a.x - b.x, a.y - b.y, a.z - b.z};
}

static vec scaled(vec v, double by)
{
    return (vec){v.x * by, v.y * by, v.z * by};
}

static double dot(vec a, vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static vec cross(vec a, vec b)
{
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Return v + a x b, added from left to right. */
static vec add_cross(vec v, vec a, vec b)
{
    return (vec){
        v.x + a.y * b.z - a.z * b.y, v.y + a.z * b.x - a.x * b.z, v.z + a.x * b.y - a.y * b.x};
}

/* Return M v. */
static vec apply(const mat *m, vec v)
{
    return (vec){dot(m->x, v), dot(m->y, v), dot(m->z, v)};
}

/* Return the transpose of M times v. */
static vec apply_transposed(const mat *m, vec v)
{
    return (vec){
        m->x.x * v.x + m->y.x * v.y + m->z.x * v.z,
        m->x.y * v.x + m->y.y * v.y + m->z.y * v.z,
        m->x.z * v.x + m->y.z * v.y + m->z.z * v.z,
    };
}

/* Return the transpose of M. */
static mat transposed(const mat *m)
{
    return (mat){
        {m->x.x, m->y.x, m->z.x},
        {m->x.y, m->y.y, m->z.y},
        {m->x.z, m->y.z, m->z.z},
    };
}

#endif
